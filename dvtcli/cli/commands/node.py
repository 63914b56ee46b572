"""Show a node's identity; at the prompt and in scripts `node ID` also selects it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import NODE_ID

if TYPE_CHECKING:
    from dvtcli.operations.results import NodeListing
    from dvtcli.operations.session.session import Session


@click.command(
    "node",
    cls=DvtCommand,
    short_help=__doc__,
    effect=Effect.SELECTS,
    each=lambda params: params["node_id"] is None,
)
@click.argument("node_id", type=NODE_ID, required=False, metavar="[ID]")
@click.pass_obj
def command(session: Session, /, node_id: int | None) -> NodeListing:
    """Identify a node, and select it for the lines that follow.

    \b
    node
    node 5
    """
    from dvtcli.operations.nodes.find_nodes import identify

    return identify(session, node_id)
