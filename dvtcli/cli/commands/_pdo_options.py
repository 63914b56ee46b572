"""PDOs as arguments of commands: the options of `map` and `set`, PDOs of one node, and the ends of a link."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from dvtcli.cli.params import MillisecondsType, NumberType
from dvtcli.cli.pdo_params import COB_ID, TransmissionType
from dvtcli.domain.request import PdoRequest

if TYPE_CHECKING:
    from dvtcli.cli.pdo_params import NodePdo
    from dvtcli.domain.network.network_config import Endpoint
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.session.session import SessionNodes


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
        raise click.UsageError("--type, --sync and --event exclude each other: give only one of them")
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


def one_node(pdos: Iterable[NodePdo]) -> tuple[int | None, list[Pdo]]:
    """Return the common node-ID of *pdos* (None if unnamed), and the PDOs.

    Raises UsageError if they name several nodes.
    """
    chosen = list(pdos)
    node_ids = {pdo.node_id for pdo in chosen}
    if len(node_ids) > 1:
        raise click.UsageError("PDOs of several nodes: use one line for each node")
    return node_ids.pop(), [pdo.pdo for pdo in chosen]


def endpoints(session: SessionNodes, words: Iterable[NodePdo]) -> list[Endpoint]:
    """Return the PDOs of *words*, each with its node."""
    from dvtcli.domain.network.network_config import Endpoint

    return [Endpoint(session.node_id() if word.node_id is None else word.node_id, word.pdo) for word in words]
