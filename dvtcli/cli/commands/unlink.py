"""Disconnect RPDOs from a TPDO."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._file_plans import show_plan
from dvtcli.cli.commands._pdo_options import endpoints
from dvtcli.cli.params import Listed
from dvtcli.cli.pdo_params import PDO, NodePdo

if TYPE_CHECKING:
    from dvtcli.operations.results import NetworkApplied


@click.command("unlink", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("producer", type=PDO, metavar="NODE:TPDO")
@click.argument("consumers", cls=Listed, type=PDO, nargs=-1, required=True, metavar="NODE:RPDO...")
@click.option("--no-heartbeat", "silent", is_flag=True, help="Leave 0x1016 alone.")
@click.pass_context
def command(ctx: click.Context, /, producer: NodePdo, consumers: tuple[NodePdo, ...], silent: bool) -> NetworkApplied:
    """Disable each RPDO that receives the TPDO, and keep its mapping; the TPDO stays on: others may receive it.

    A node that receives nothing else of the producer's node stops watching its heartbeat.

    \b
    unlink 1:tpdo1 5:rpdo2
    """
    from dvtcli.operations.plans.link_pdos import unlink_pdos

    sender, *hearers = endpoints(ctx.obj, (producer, *consumers))
    return unlink_pdos(ctx.obj, sender, hearers, heartbeat=not silent, on_plan=partial(show_plan, ctx.obj.output))
