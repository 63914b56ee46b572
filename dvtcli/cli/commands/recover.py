"""Finish an interrupted change: put the old configuration back from its journal, or close the journal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed, ChangedNodes, Facts
    from dvtcli.operations.session.session import Session


@click.command("recover", cls=DvtCommand, short_help=__doc__, effect=Effect.BRINGS_BACK)
@click.argument("file", type=FILE, required=False)
@click.option("--accept", is_flag=True, help="Take what the device holds as the new state; nothing is written to it.")
@click.option("--discard", is_flag=True, help="Set a journal that cannot be used aside, under another name.")
@click.option("--finish", is_flag=True, help="Go on with the stores of a network file: every node had been verified.")
@click.pass_obj
def command(
    session: Session, /, file: str | None, accept: bool, discard: bool, finish: bool
) -> Changed | ChangedNodes | Facts:
    """Read the node, put back what the interrupted change replaced, and verify it.

    \b
    recover
    recover --dry-run          shows what would be written
    recover --finish           where apply ended while the nodes stored
    recover --accept           where the device does not take the old state back
    recover can0-5.json        a journal that was kept elsewhere
    """
    from dvtcli.operations.recover.recover_change import recover

    return recover(session, file, accept=accept, discard=discard, finish=finish)
