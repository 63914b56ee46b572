"""The global options: one list, read before and after a command, from the environment and from `dvtcli.toml`.

Knows their names and which of them a single line may change. Does not act on any.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import click

#: Prefix of the parameters' names, so that a command's own `--type` or `--node` can never meet them.
PREFIX = "global_"
#: Put before an argument such as `-1500`, so that click does not take it for an option; `params` takes it off.
NEGATIVE_MARK = "\ue000"
#: The key of `dvtcli.toml` that is no option: what `login` would ask for.
PASSCODE = "passcode"
#: The table of `dvtcli.toml` with words of the prompt's user.
ALIASES = "aliases"
#: A `dvtcli.toml` is a few lines; beyond this many bytes it is something else.
_MOST_BYTES = 100_000
#: What only the start of the program may choose: a bus, a node's files, where things are kept.
START_ONLY = frozenset(
    {
        "interface",
        "channel",
        "bitrate",
        "bus_kwargs",
        "node",
        "sim",
        "fault",
        "signal",
        "eds",
        "profile",
        "journal",
        "color",
        "ascii",
        "no_shell",
    }
)


class Options(NamedTuple):
    """The global options with their defaults; *timeout* is the SDO time-out in seconds.

    A named tuple, since `--help` needs none of what a dataclass costs to make.
    """

    interface: str | None = None
    channel: str | None = None
    bitrate: int | None = None
    bus_kwargs: tuple[str, ...] = ()
    node: int | None = None
    sim: tuple[str, ...] = ()
    fault: tuple[str, ...] = ()
    signal: tuple[str, ...] = ()
    dry_run: bool = False
    eds: str | None = None
    profile: str | None = None
    format: str = "text"
    quiet: bool = False
    verbose: int = 0
    color: str = "auto"
    ascii: bool = False
    no_shell: bool = False
    yes: bool = False
    force: bool = False
    timeout: float = 0.5
    journal: str | None = None

    @property
    def json(self) -> bool:
        """Whether results are JSON documents."""
        return self.format in ("json", "jsonl")


def global_options(*, hidden: bool) -> list[click.Option]:
    """The global options as click parameters; *hidden* ones stand behind every command."""
    return [_option(names, dict(settings), hidden=hidden) for names, settings in _TABLE]


_TABLE: list[tuple[tuple[str, ...], dict[str, Any]]] = [
    (("-i", "--interface"), {"metavar": "NAME", "help": "CAN interface, by python-can's name (socketcan, pcan, …)."}),
    (("-c", "--channel"), {"metavar": "NAME", "help": "Channel of the interface (can0, PCAN_USBBUS1, …)."}),
    (("-b", "--bitrate"), {"type": click.IntRange(1_000, 1_000_000), "metavar": "BIT/S", "help": "Bit rate in bit/s."}),
    (("--bus-kwargs",), {"multiple": True, "metavar": "KEY=VALUE", "help": "More of python-can's keys; repeatable."}),
    (("-n", "--node"), {"metavar": "ID", "help": "Node-ID 1…127, decimal or 0x."}),
    (("--sim",), {"multiple": True, "metavar": "WHAT[@ID]", "help": "Simulated node: a family or an EDS/DCF file."}),
    (
        ("--fault",),
        {
            "multiple": True,
            "metavar": "[NODE:]FAULT",
            "help": "What goes wrong with the (first) simulated node, at its K-th SDO download: refuse@K=0x06040041, "
            "lose-response@K, reset@K, …; a wrong one lists all; repeatable.",
        },
    ),
    (
        ("--signal",),
        {
            "multiple": True,
            "metavar": "[NODE:]OBJECT=SHAPE(…)",
            "help": "An object of a simulated node that moves: 606C=sine(1500,2s), ramp, square, walk, const, csv; "
            "a wrong one lists all; repeatable.",
        },
    ),
    (("--dry-run",), {"is_flag": True, "help": "Work on an exact twin of the node; write nothing to the bus."}),
    (("--eds",), {"metavar": "FILE", "help": "EDS or DCF of the node."}),
    (("-p", "--profile"), {"metavar": "NAME", "help": "Device family; else found from the node's identity."}),
    (("--json", "format"), {"flag_value": "json", "is_flag": True, "help": "Results as JSON (same as --format json)."}),
    (("--format", "format"), {"type": click.Choice(["text", "json", "jsonl"]), "help": "How results are printed."}),
    (("-q", "--quiet"), {"is_flag": True, "help": "Only results and errors."}),
    (("-v", "--verbose"), {"count": True, "help": "Show each SDO; -vv each frame."}),
    (("--color",), {"type": click.Choice(["auto", "always", "never"]), "help": "Colours [auto]."}),
    (("--ascii",), {"is_flag": True, "help": "No characters beyond ASCII on screens."}),
    (("--no-shell",), {"is_flag": True, "help": "At the prompt: no `|`, so that no program is started."}),
    (("-y", "--yes"), {"is_flag": True, "help": "Answer questions with yes."}),
    (("--force",), {"is_flag": True, "help": "Send what dvtcli's own rules refuse."}),
    (("--timeout",), {"metavar": "S", "help": "SDO time-out in seconds [0.5]."}),
    (("--journal",), {"metavar": "DIR", "help": "Folder of journals, locks and backups."}),
]


_REPEATED = frozenset(names[-1].lstrip("-").replace("-", "_") for names, how in _TABLE if how.get("multiple"))


def one_pair_each(args: Sequence[str]) -> None:
    """Refuse `--bus-kwargs a=1 b=2`, which other programs take; click.UsageError with the hint."""
    for option, _, behind in zip(args, args[1:], args[2:], strict=False):
        if option == "--bus-kwargs" and re.fullmatch(r"\w+=.*", behind):
            raise click.UsageError(f"--bus-kwargs takes one KEY=VALUE; repeat it: --bus-kwargs {behind}")


def _option(names: tuple[str, ...], settings: dict[str, Any], *, hidden: bool) -> click.Option:
    plain = names[-1].lstrip("-").replace("-", "_")
    switches = [name for name in names if name.startswith("-")]
    if not hidden and settings.get("flag_value") is None:
        settings.setdefault("envvar", f"DVTCLI_{plain.upper()}")
    settings["hidden"] = hidden or settings.get("hidden", False)
    if settings.get("is_flag") and "flag_value" not in settings:
        settings["default"] = None
    if not settings.get("multiple") and not settings.get("count"):
        settings["default"] = None
    return click.Option([*switches, PREFIX + plain], expose_value=True, **settings)


def taken(params: dict[str, Any]) -> dict[str, Any]:
    """Take the global options out of *params* and return those that were given, checked and typed."""
    given: dict[str, Any] = {}
    for key in [key for key in params if key.startswith(PREFIX)]:
        value, name = params.pop(key), key.removeprefix(PREFIX)
        if value not in (None, (), 0, False):
            given[name] = _checked(name, value)
    return given


def source_of(ctx: click.Context, name: str) -> str:
    """Where the global option *name* was said, for people."""
    source = ctx.get_parameter_source(PREFIX + name)
    if source is click.core.ParameterSource.ENVIRONMENT:
        return f"DVTCLI_{name.upper()}"
    return "dvtcli.toml" if source is click.core.ParameterSource.DEFAULT_MAP else "option"


def _checked(name: str, value: Any) -> Any:
    if name == "node":
        return node_id(str(value))
    if name == "timeout":
        return _seconds(str(value))
    if name == "bus_kwargs":
        for pair in value:
            if "=" not in pair:
                raise click.UsageError(f"--bus-kwargs takes KEY=VALUE, not {pair!r}; repeat the option for each pair")
    return value


def node_id(text: str) -> int:
    """Read a node-ID, decimal or `0x…`, 1..127; click.UsageError otherwise."""
    digits = text[2:] if text.lower().startswith("0x") else text
    try:
        value = int(digits, 16 if digits != text else 10) if digits.isalnum() and digits.isascii() else -1
    except ValueError:
        value = -1
    if not 1 <= value <= 127:
        raise click.UsageError(f"{text!r} is not a node-ID; node-IDs are 1…127, decimal or 0x")
    return value


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.001 <= value <= 600:
        raise click.UsageError(f"--timeout {text}: a time-out is 0.001…600 seconds")
    return value


def is_file(text: str) -> bool:
    """Whether *text* is the path of a file; what can be no path at all (too long, say) is none."""
    return os.path.isfile(text)  # noqa: PTH113 - Path.is_file raises OSError for a name that is too long


def file_defaults(start: str | None = None) -> dict[str, Any]:
    """The keys of the nearest `dvtcli.toml` at or above *start* as defaults for the root command.

    Raises InputFileError where the file is no TOML or has an unknown key.
    """
    path = settings_file(start)
    return {} if path is None else _read_defaults(path)


def file_passcode() -> str | None:
    """The passcode that the nearest `dvtcli.toml` holds, as it is written there; None where it holds none."""
    path = settings_file()
    value = None if path is None else _keys(path).get(PASSCODE)
    return None if value is None else str(value)


def file_aliases() -> dict[str, str]:
    """The table `[aliases]` of the nearest `dvtcli.toml`: a word, and the beginning of a line that it stands for.

    Raises InputFileError where it is no table of texts, or a word could not be typed as one.
    """
    from dvtcli.errors import InputFileError

    path = settings_file()
    found = {} if path is None else _keys(path).get(ALIASES, {})
    if not isinstance(found, dict):
        raise InputFileError(f"{path}: {ALIASES} is a table", place=path, hint='[aliases]  then  v = "read 606C"')
    for word, text in found.items():
        if not re.fullmatch(r"[\w.-]+", word) or not isinstance(text, str) or not text.strip() or "\n" in text:
            raise InputFileError(
                f"{path}: the alias {word!r} is not one word that stands for one line",
                place=path,
                hint='[aliases]  then  v = "read 606C"',
            )
    return found


def settings_file(start: str | None = None) -> str | None:
    """The path of the nearest `dvtcli.toml` at or above *start* (default: here), None where there is none."""
    folder = os.path.abspath(start or os.curdir)  # noqa: PTH100 - pathlib costs 7 ms of a --help
    while True:
        path = os.path.join(folder, "dvtcli.toml")  # noqa: PTH118
        if os.path.isfile(path):  # noqa: PTH113
            return path
        folder, below = os.path.dirname(folder), folder  # noqa: PTH120
        if folder == below:
            return None


def _read_defaults(path: str) -> dict[str, Any]:
    from dvtcli.errors import InputFileError

    keys = _keys(path)
    keys.pop(PASSCODE, None)  # no option: it would stand in process lists
    keys.pop(ALIASES, None)
    known = {names[-1].lstrip("-").replace("-", "_") for names, _ in _TABLE}
    unknown = sorted(key for key in keys if key.replace("-", "_") not in known)
    if unknown:
        raise InputFileError(
            f"{path}: unknown key {unknown[0]!r}",
            place=path,
            hint=f"keys are the options: {', '.join(sorted(known))}; and {PASSCODE}, [{ALIASES}]",
        )
    return {PREFIX + key.replace("-", "_"): _setting(path, key, value) for key, value in keys.items()}


def _keys(path: str) -> dict[str, Any]:
    import tomllib

    from dvtcli.errors import InputFileError

    try:
        with open(path, "rb") as file:  # noqa: PTH123
            data = file.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise InputFileError(f"{path}: more than {_MOST_BYTES} bytes are no settings", place=path)
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as wrong:  # no TOML, no UTF-8, a number of 5000 digits, too deep a nest
        raise InputFileError(f"{path}: not valid TOML: {wrong}", place=path) from wrong


def _setting(path: str, key: str, value: Any) -> Any:
    """A key's value as click takes it: an option that may be repeated is a list, also where there is one alone."""
    from dvtcli.errors import InputFileError

    name = key.replace("-", "_")
    if name not in _REPEATED:
        right, kinds = _fits(name, value)
        if not right:
            raise InputFileError(f"{path}: {key} is {kinds}", place=path)
        return value
    values = [value] if isinstance(value, str) else value
    if not isinstance(values, list) or not all(map(_is_text, values)):
        raise InputFileError(f"{path}: {key} is a text or a list of texts", place=path)
    return values


def _fits(name: str, value: Any) -> tuple[bool, str]:
    """Whether *value* is of a kind that the option *name* takes, and which kinds those are."""
    default = getattr(Options(), name)
    if isinstance(default, bool):
        return isinstance(value, bool), "true or false"
    if type(default) is int:
        return type(value) is int and 0 <= value < 10, "a number, 0…9"
    # finite, and no number of 5000 digits: Python refuses to write those out
    number = type(value) in (int, float) and abs(value) < 1 << 64
    return number or _is_text(value), "a text or a number"


def _is_text(value: Any) -> bool:
    """Whether *value* is a text that can be a path or a name."""
    return isinstance(value, str) and "\0" not in value
