"""The global options: one list, read before and after a command and from the environment.

Knows their names and which of them a single line may change. Does not know settings files (`settings`) nor act on any.
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
#: What only the start of the program may choose: a bus, a node's files, where things are kept.
START_ONLY = frozenset(
    {
        "interface",
        "channel",
        "bitrate",
        "bus_kwargs",
        "bus",
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
    bus: str | None = None
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
    (("--bus",), {"metavar": "NAME", "help": "The bus that a settings file describes in its table [bus.NAME]."}),
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


def _plain(names: tuple[str, ...]) -> str:
    return names[-1].lstrip("-").replace("-", "_")


_REPEATED = frozenset(_plain(names) for names, how in _TABLE if how.get("multiple"))


def one_pair_each(args: Sequence[str]) -> None:
    """Refuse `--bus-kwargs a=1 b=2`, which other programs take; click.UsageError with the hint."""
    for option, _, behind in zip(args, args[1:], args[2:], strict=False):
        if option == "--bus-kwargs" and re.fullmatch(r"\w+=.*", behind):
            raise click.UsageError(f"--bus-kwargs takes one KEY=VALUE; repeat it: --bus-kwargs {behind}")


def _option(names: tuple[str, ...], settings: dict[str, Any], *, hidden: bool) -> click.Option:
    plain = _plain(names)
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


def by_variable(ctx: click.Context, name: str) -> bool:
    """Whether the global option *name* comes from its variable, and not from the command line."""
    return ctx.get_parameter_source(PREFIX + name) is click.core.ParameterSource.ENVIRONMENT


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


def option_names() -> list[str]:
    """Every global option as it is called in a settings file, sorted."""
    return sorted({_plain(names) for names, _ in _TABLE})


def is_repeated(name: str) -> bool:
    """Whether the global option *name* may be given several times, and is a list in a settings file."""
    return name in _REPEATED


def from_text(name: str, value: Any) -> Any:
    """*value* of the option *name* as a command line would give it; click.UsageError where it is wrong."""
    how = next(dict(settings) for names, settings in _TABLE if _plain(names) == name and "flag_value" not in settings)
    if how.get("is_flag") or how.get("count"):
        return value
    option = click.Option([f"--{name}"], **{key: how[key] for key in ("type", "multiple") if key in how})
    return _checked(name, option.type_cast_value(click.Context(click.Command("dvtcli")), value))
