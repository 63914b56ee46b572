"""Find the nodes on the bus, by heartbeats and by asking each node-ID for its device type."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import NumberType

if TYPE_CHECKING:
    from dvtcli.operations.results import NodeListing
    from dvtcli.operations.session.session import Session


@click.command("scan", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE)
@click.option(
    "--wait",
    type=NumberType(10, 10_000, "a time in ms"),
    metavar="MS",
    help="Milliseconds to wait for each node-ID [50].",
)
@click.pass_obj
def command(session: Session, /, wait: int | None) -> NodeListing:
    """List the nodes 1-127 that send heartbeats or answer.

    \b
    scan
    scan --wait 200      for slow nodes
    """
    from dvtcli.operations.nodes.find_nodes import find_nodes

    return find_nodes(session) if wait is None else find_nodes(session, wait / 1000)
