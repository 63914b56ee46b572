"""The load of a bus: what its frames need at worst, when each is there at the latest, and what is on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._live_params import DurationType
from dvtcli.cli.commands._load_params import BitRateType, InhibitType, PeriodType
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import NetworkLoad
    from dvtcli.operations.session.session import Session


@click.command("load", cls=DvtCommand, short_help=__doc__, effect=Effect.READS)
@click.argument("file", type=FILE, required=False)
@click.option("--for", "for_s", type=DurationType(0, 3600), metavar="TIME", help="Listen so long [3]; 0: not at all.")
@click.option("--at", "bit_rate", type=BitRateType(), metavar="BIT/S", help="As if the bus ran at this bit rate.")
@click.option("--sync", "sync_ms", type=PeriodType("ms", 0.1, 100_000), metavar="MS", help="As if SYNC came so often.")
@click.option(
    "--emcy", "emcy_ms", type=PeriodType("ms", 0.1, 1e7), metavar="MS", help="EMCY of a node without 0x1015 [1000]."
)
@click.option("--inhibit", type=InhibitType(), multiple=True, metavar="[NODE:]tpdoN=MS", help="As if it were so.")
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
    """Compute what the frames of a network need of its bus at worst, and listen to what is on it.

    With FILE its nodes count, without a bus as their EDS, DCF or family comes up; else the nodes on the bus. Response
    times are exact for the worst case; what nothing limits is unbounded. The bit rate is that of --at,
    of the bus, or -b.

    \b
    load line.yaml --at 250000
    load line.yaml --inhibit 5:tpdo1=40 --at 125000
    load line.yaml --inhibit io:tpdo1=40    a node by its name in the file
    load --for 5      what is on the bus, and what its nodes could send
    """
    from dvtcli.operations.network.network_load import MEASURED_S, LoadOptions, network_load

    wishes = LoadOptions(
        MEASURED_S if for_s is None else for_s,
        bit_rate,
        sync_ms,
        emcy_ms,
        {(node_id, pdo): time for node_id, pdo, time in inhibit},
    )
    return network_load(session, file, wishes)
