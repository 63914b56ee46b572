"""Compute the worst-case bus load and response times, and compare with the traffic on the bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE, BitRateType, DurationType, InhibitType, PeriodType
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import NetworkLoad
    from dvtcli.operations.session.session import Session


@click.command("load", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.argument("file", type=FILE, required=False)
@click.option("--for", "for_s", type=DurationType(0, 3600), metavar="TIME", help="Time to receive [3s]; 0: none.")
@click.option("--at", "bit_rate", type=BitRateType(), metavar="BIT/S", help="Compute for this bit rate.")
@click.option(
    "--sync", "sync_ms", type=PeriodType("ms", 0.1, 100_000), metavar="MS", help="Compute for this SYNC period."
)
@click.option(
    "--emcy",
    "emcy_ms",
    type=PeriodType("ms", 0.1, 1e7),
    metavar="MS",
    help="Assume at most one EMCY in this time for a node without 0x1015 [1000].",
)
@click.option(
    "--inhibit", type=InhibitType(), multiple=True, metavar="[NODE:]tpdoN=MS", help="Compute with this inhibit time."
)
@click.pass_obj
def command(
    session: Session,
    /,
    file: str | None,
    for_s: float | None,
    bit_rate: int | None,
    sync_ms: float | None,
    emcy_ms: float | None,
    inhibit: tuple[tuple[int | str | None, Pdo, int], ...],
) -> NetworkLoad:
    """Compute the worst case of all frames of a network, and listen to the traffic on the bus.

    With FILE its nodes are computed without a bus, as their EDS, DCF or family describes them; else the nodes on the
    bus. Response times are exact for the worst case; a frame without a limit is unbounded. The bit rate is that of
    --at, of the bus, or -b.

    \b
    load line.yaml --at 250000
    load line.yaml --inhibit 5:tpdo1=40 --at 125000
    load line.yaml --inhibit io:tpdo1=40    a node by its name in the file
    load --for 5      the traffic on the bus, and its worst case
    """
    from dvtcli.operations.network.live_network import has_bus
    from dvtcli.operations.network.network_load import MEASURED_S, LoadOptions, network_load

    if file is not None and not has_bus(session):
        refuse_options({"for_s": for_s or None}, "only with a bus, from which it receives")
    options = LoadOptions(
        MEASURED_S if for_s is None else for_s,
        bit_rate,
        sync_ms,
        emcy_ms,
        {(node_id, pdo): time for node_id, pdo, time in inhibit},
    )
    return network_load(session, file, options)
