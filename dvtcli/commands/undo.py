"""Put the last change back, or all of this session's."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from dvtcli.commands._changing import changed
from dvtcli.errors import UsageError
from dvtcli.shell import DvtCommand

if TYPE_CHECKING:
    from dvtcli.results import Changed
    from dvtcli.session import Session


@click.command("undo", cls=DvtCommand, short_help=__doc__)
@click.option("--all", "everything", is_flag=True, help="Every change of this session, last first.")
@click.pass_obj
def command(session: Session, /, everything: bool) -> Changed:
    """Put back what the last change replaced.

    \b
    undo
    undo --all
    """
    node = session.node()
    if not node.history:
        raise UsageError("nothing to undo: this session changed nothing on the node", node=node.node_id)
    started = time.monotonic()
    applied = node.undo(everything=everything)
    return changed(session, node, applied, time.monotonic() - started, undone=True)
