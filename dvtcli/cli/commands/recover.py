"""Roll back an interrupted change to the old configuration in its journal, or close the journal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE

if TYPE_CHECKING:
    from dvtcli.operations.results import Changed, ChangedNodes, Facts
    from dvtcli.operations.session.session import Session


@click.command("recover", cls=DvtCommand, short_help=__doc__, effect=Effect.BRINGS_BACK)
@click.argument("file", type=FILE, required=False)
@click.option("--accept", is_flag=True, help="Accept the present values as the new state; writes nothing.")
@click.option("--discard", is_flag=True, help="Set an unusable journal aside, under another name.")
@click.option("--finish", is_flag=True, help="Finish the stores of a network file, on verified nodes.")
@click.pass_obj
def command(
    session: Session, /, file: str | None, accept: bool, discard: bool, finish: bool
) -> Changed | ChangedNodes | Facts:
    """Read the node, roll the interrupted change back, and verify it.

    \b
    recover
    recover --dry-run          shows what would be written
    recover --finish           after an apply that ended during the stores
    recover --accept           if the device refuses the old state
    recover can0-5.json        a journal that was kept elsewhere
    """
    from dvtcli.operations.changes.recover_change import recover

    return recover(session, file, accept=accept, discard=discard, finish=finish)
