"""The common options of `map` and `set`, as one request."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from dvtcli.cli.params import MillisecondsType, NumberType
from dvtcli.cli.pdo_params import COB_ID, TransmissionType
from dvtcli.domain.request import PdoRequest

F = TypeVar("F", bound=Callable[..., Any])

_OPTIONS = [
    click.option("--cob-id", type=COB_ID, metavar="ID", help="CAN-ID with 0x, `auto` or `keep`."),
    click.option("--type", "type_", type=TransmissionType(), metavar="N",
                 help="Transmission type 0…255."),
    click.option("--sync", type=NumberType(1, 240, "a number of SYNCs"), metavar="N", help="On every N-th SYNC."),
    click.option("--event", is_flag=True, help="Event-driven (type 255)."),
    click.option("--inhibit", type=MillisecondsType(100), metavar="MS", help="Inhibit time in ms (steps of 0.1)."),
    click.option("--timer", type=MillisecondsType(1000), metavar="MS", help="Event timer in ms; 0 is off."),
    click.option("--sync-start", type=NumberType(0, 240, "a SYNC start value"), metavar="N", help="SYNC start value."),
    click.option("--rtr/--no-rtr", "rtr", default=None, help="Bit 30 of the COB-ID: RTR allowed or not."),
    click.option("--extended", is_flag=True, help="A 29-bit CAN-ID."),
    click.option("--off", is_flag=True, help="Leave the PDO disabled."),
]  # fmt: skip


def pdo_options(function: F) -> F:
    """Add the options that describe a PDO."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def request(options: dict[str, Any], *, enabled: bool | None) -> PdoRequest:
    """Return the request in *options*; *enabled* is the PDO's new state unless --off is given."""
    kinds = [name for name in ("type_", "sync") if options[name] is not None] + (["event"] if options["event"] else [])
    if len(kinds) > 1:
        raise click.UsageError("--type, --sync and --event exclude each other: give one")
    kind = 255 if options["event"] else options["sync"] if options["type_"] is None else options["type_"]
    return PdoRequest(
        cob_id=options["cob_id"],
        transmission_type=kind,
        inhibit_time=options["inhibit"],
        event_timer=options["timer"],
        sync_start_value=options["sync_start"],
        rtr_allowed=options["rtr"],
        extended=options["extended"],
        enabled=False if options["off"] else enabled,
    )
