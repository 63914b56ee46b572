"""Imports point inward: domain <- device, simulator, formats <- session <- params <- commands <- shell <- cli."""

from __future__ import annotations

from tests.house.source import PACKAGE, modules

#: what each room may import of ours, beside itself and `dvtcli` (the version); a flat file is a room of its own
MAY: dict[str, set[str]] = {
    "domain": set(),
    "errors": {"domain"},
    "device": {"domain", "errors"},
    "simulator": {"domain"},
    "formats": {"domain", "errors"},
    "transports": {"domain", "errors", "simulator"},
    "results": {"domain"},
    "live": {"domain", "errors", "results", "view", "session"},
    "view": {"domain", "errors", "results"},
    "options": {"errors"},
    "simulated": {"domain", "errors", "formats", "options", "simulator"},
    "network": {"domain", "errors", "device", "formats", "options", "simulated", "simulator", "transports"},
    "serving": {"domain", "errors", "formats", "options", "simulated", "simulator", "transports"},
    "session": {"domain", "errors", "device", "formats", "options", "network", "serving", "view"},
    "params": {"domain", "errors", "device", "options", "session", "completion"},
    "completion": {"domain", "errors", "device", "formats", "options", "session", "network", "params"},
    "commands": {
        "domain", "errors", "device", "formats", "options", "session", "params", "results", "shell", "script",
        "completion", "serving", "guide", "health", "live", "transports", "dvt",
    },
    "dvt": {
        "domain", "errors", "device", "session", "params", "results", "shell", "commands", "boundary", "script",
    },
    "guide": {"options", "shell"},
    "health": {"domain", "errors", "formats", "options", "results", "session", "transports"},
    "boundary": {"errors", "session"},
    "shell": {"errors", "options", "session", "results", "boundary", "commands", "front", "guide", "dvt"},
    "script": {"errors", "session", "shell", "boundary"},
    "front": {"errors", "session", "script", "repl", "shell"},
    "prompt": {
        "domain", "errors", "device", "options", "session", "params", "results", "shell", "view", "completion",
        "boundary", "transports", "formats", "dvt",
    },
    "repl": {
        "domain", "errors", "options", "session", "shell", "view", "prompt", "completion", "boundary", "device",
        "transports",
    },
    "cli": {"options", "session", "shell", "view", "errors"},
    "__main__": {"cli"},
    "__init__": set(),
}  # fmt: skip

#: libraries that only some files may touch
ONLY_IN: dict[str, tuple[str, ...]] = {
    "can": ("transports/", "simulator/node.py", "simulator/network.py"),
    "canopen": ("transports/",),
    "prompt_toolkit": ("prompt/", "repl.py", "live/app.py"),
    "rich": ("view/",),
    "click": (
        "shell.py", "options.py", "params.py", "completion.py", "cli.py", "front.py", "boundary.py", "script.py",
        "commands/", "prompt/", "repl.py", "view/", "dvt/command.py",
    ),
}  # fmt: skip


def test_imports_point_inward() -> None:
    for module in modules():
        allowed = MAY[module.room] | {module.room}
        for name, line, _ in module.imports():
            head, _, rest = name.partition(".")
            if head == "dvtcli":
                room = rest.split(".")[0] if rest and rest != "__version__" else ""
                assert not room or room in allowed, (
                    f"{module.name}:{line} imports {name}; {module.room} may import {allowed}"
                )


def test_libraries_stay_in_their_rooms() -> None:
    for module in modules():
        for name, line, typing_only in module.imports():
            places = ONLY_IN.get(name.partition(".")[0])
            if places is not None and not typing_only:
                assert module.name.startswith(places), f"{module.name}:{line} imports {name}; only {places} may"


def test_the_domain_needs_the_standard_library_only() -> None:
    import sys

    for module in modules():
        if module.room in ("domain", "device", "simulator", "errors"):
            foreign = {name.partition(".")[0] for name, _, typing_only in module.imports() if not typing_only}
            foreign -= {*sys.stdlib_module_names, "dvtcli"}
            assert not foreign or module.name in ("simulator/node.py", "simulator/network.py"), (module.name, foreign)


def test_the_simulator_never_looks_at_the_rules() -> None:
    for module in modules():
        if module.room == "simulator":
            assert not [name for name, _, _ in module.imports() if name.startswith("dvtcli.domain.rules")], module.name


def test_every_room_is_known() -> None:
    assert {module.room for module in modules()} <= set(MAY)
    assert (PACKAGE / "profiles").is_dir()
    assert not list((PACKAGE / "profiles").glob("*.py")), "profiles are data"
