"""Restore the node's defaults (0x1011 "load")."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._store_group import StoreGroup
from dvtcli.cli.effect import Effect
from dvtcli.operations.stores.store_restore import restore_defaults

if TYPE_CHECKING:
    from dvtcli.operations.results import Stored
    from dvtcli.operations.session.session import Session


@click.command("restore", cls=DvtCommand, short_help=__doc__, effect=Effect.BRINGS_BACK)
@click.argument("group", type=StoreGroup(), required=False, metavar="[all|communication|application|N]")
@click.option("--prove", is_flag=True, help="Reset the node at once, and check that it has its defaults.")
@click.pass_obj
def command(session: Session, /, group: int | None, prove: bool) -> Stored:
    """Restore the node's defaults (0x1011 "load"); they take effect with the next reset.

    \b
    restore
    restore communication
    restore --prove
    """
    return restore_defaults(session, session.node(), group, prove=prove)
