"""Store what the node holds, so that it survives a power cycle (0x1010 "save")."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.commands._storing import StoreGroup, store_settings
from dvtcli.shell import DvtCommand

if TYPE_CHECKING:
    from dvtcli.results import Stored
    from dvtcli.session import Session


@click.command("store", cls=DvtCommand, short_help=__doc__)
@click.argument("group", type=StoreGroup(), required=False, metavar="[all|communication|application|N]")
@click.option("--prove", is_flag=True, help="Reset the node and read back what it kept.")
@click.pass_obj
def command(session: Session, /, group: int | None, prove: bool) -> Stored:
    """Store the node's settings.

    \b
    store
    store communication
    store --prove
    """
    return store_settings(session, session.node(), group, prove=prove)
