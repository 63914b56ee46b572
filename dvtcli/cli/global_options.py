"""The global options as typed: one list, read before and after a command and from the environment."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import click

from dvtcli.errors import UsageError
from dvtcli.operations.user.options import CHOICES, checked

#: Beginning of the names of variables for options.
VARIABLES = "DVTCLI_"
#: Prefix of the parameters' names, to avoid a clash with a command's own `--type` or `--node`.
PREFIX = "global_"
#: Put before an argument such as `-1500`, so that click does not take it for an option; `params` takes it off.
NEGATIVE_MARK = "\ue000"


def global_options(*, hidden: bool) -> list[click.Option]:
    """Return the global options as click parameters; *hidden* options follow every command."""
    return [_option(names, dict(settings), hidden=hidden) for names, settings in _TABLE]


_TABLE: list[tuple[tuple[str, ...], dict[str, Any]]] = [
    (("-i", "--interface"), {"metavar": "NAME", "help": "CAN interface, by python-can's name (socketcan, pcan, …)."}),
    (("-c", "--channel"), {"metavar": "NAME", "help": "Channel of the interface (can0, PCAN_USBBUS1, …)."}),
    (("-b", "--bitrate"), {"metavar": "BIT/S", "help": "Bit rate in bit/s: 250000, or 250k."}),
    (("--bus-kwargs",), {"multiple": True, "metavar": "KEY=VALUE", "help": "Further python-can keys; repeatable."}),
    (("--bus",), {"metavar": "NAME", "help": "Bus from the table [bus.NAME] of a settings file."}),
    (("-n", "--node"), {"metavar": "ID", "help": "Node-ID 1…127, decimal or 0x; several: 1,3,5-9, or all."}),
    (("--sim",), {"multiple": True, "metavar": "WHAT[@ID]", "help": "Simulated node: a family or an EDS/DCF file."}),
    (
        ("--fault",),
        {
            "multiple": True,
            "metavar": "[NODE:]FAULT",
            "help": "Fault of the (first) simulated node, at its K-th SDO download: refuse@K=0x06040041, "
            "lose-response@K, reset@K, … (an unknown name lists all); repeatable.",
        },
    ),
    (
        ("--signal",),
        {
            "multiple": True,
            "metavar": "[NODE:]OBJECT=SHAPE(…)",
            "help": "Changing value of a simulated node: 606C=sine(1500,2s), ramp, square, walk, const, csv; "
            "an unknown name lists all; repeatable.",
        },
    ),
    (("--dry-run",), {"is_flag": True, "help": "Work on a twin of the node; write nothing to the bus."}),
    (
        ("--eds",),
        {"metavar": "FILE", "help": "EDS, DCF, XDD or XDC of the node, a simulated family, or a name of `eds list`."},
    ),
    (
        ("--modules",),
        {
            "multiple": True,
            "metavar": "[NODE:]N,N,…",
            "help": "Connected modules of a modular device, by their numbers in its EDS: 1,1,2; repeatable "
            "[read from 0x1027].",
        },
    ),
    (("-p", "--profile"), {"metavar": "NAME", "help": "Device family [found by the node's identity]."}),
    (("--json", "format"), {"flag_value": "json", "is_flag": True, "help": "Results as JSON (same as --format json)."}),
    (("--format", "format"), {"type": click.Choice(CHOICES["format"]), "help": "How results are printed."}),
    (("-q", "--quiet"), {"is_flag": True, "help": "Only results and errors."}),
    (("-v", "--verbose"), {"count": True, "help": "Show each SDO; -vv each frame."}),
    (("--color",), {"type": click.Choice(CHOICES["color"]), "help": "Colours [auto]."}),
    (("--ascii",), {"is_flag": True, "help": "ASCII characters only."}),
    (("--no-shell",), {"is_flag": True, "help": "Switch off `|` at the prompt: no program is started."}),
    (("-y", "--yes"), {"is_flag": True, "help": "Answer questions with yes."}),
    (("--force",), {"is_flag": True, "help": "Send changes that dvtcli's own rules refuse."}),
    (("--timeout",), {"metavar": "S", "help": "SDO time-out in seconds [0.5]."}),
    (
        ("--bus-share",),
        {
            "metavar": "PERCENT",
            "help": "Bus load limit for SDO while a node is OPERATIONAL or 0x1016 is set [50]; needs the bit rate.",
        },
    ),
    (
        ("--reconnect",),
        {
            "is_flag": True,
            "help": "Wait for a missing bus; log and sim: also for a lost bus, as prompt and monitor do.",
        },
    ),
    (("--no-reconnect",), {"is_flag": True, "help": "End if the bus is lost, also the prompt and monitor."}),
    (
        ("--journal",),
        {"metavar": "DIR", "help": "Folder of journals and backups; not of locks, which all dvtcli processes share."},
    ),
]


def _plain(names: tuple[str, ...]) -> str:
    return names[-1].lstrip("-").replace("-", "_")


def one_pair_each(args: Sequence[str]) -> None:
    """Refuse `--bus-kwargs a=1 b=2`, which other programs take; click.UsageError with the hint."""
    for option, _, behind in zip(args, args[1:], args[2:], strict=False):
        if option == "--bus-kwargs" and re.fullmatch(r"\w+=.*", behind):
            raise click.UsageError(f"--bus-kwargs takes one KEY=VALUE; repeat it: --bus-kwargs {behind}")


def _option(names: tuple[str, ...], settings: dict[str, Any], *, hidden: bool) -> click.Option:
    plain = _plain(names)
    switches = [name for name in names if name.startswith("-")]
    if not hidden and settings.get("flag_value") is None:
        settings.setdefault("envvar", variable_of(plain))
    settings["hidden"] = hidden or settings.get("hidden", False)
    if settings.get("is_flag") and "flag_value" not in settings:
        settings["default"] = None
    if not settings.get("multiple") and not settings.get("count"):
        settings["default"] = None
    return click.Option([*switches, PREFIX + plain], expose_value=True, **settings)


def taken(params: dict[str, Any], ctx: click.Context | None = None) -> dict[str, Any]:
    """Remove the global options from *params*; returns those given, checked and typed.

    Raises UsageError for an invalid value, with the name of its variable if *ctx* has it from there.
    """
    given: dict[str, Any] = {}
    for key in [key for key in params if key.startswith(PREFIX)]:
        value, name = params.pop(key), key.removeprefix(PREFIX)
        if value in (None, (), 0, False):
            continue
        try:
            given[name] = checked(name, value)
        except UsageError as wrong:
            if ctx is None or not by_variable(ctx, name):
                raise
            raise UsageError(f"{variable_of(name)}: {wrong.text}", hint=wrong.hint) from wrong
    return given


def variable_of(name: str) -> str:
    """Return the name of the environment variable for the global option *name*."""
    return f"{VARIABLES}{name.upper()}"


def by_variable(ctx: click.Context, name: str) -> bool:
    """Whether the global option *name* comes from its variable, and not from the command line."""
    return ctx.get_parameter_source(PREFIX + name) is click.core.ParameterSource.ENVIRONMENT
