"""Put the last change back, or all of this session's."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import click

from dvtcli.commands._changing import changed
from dvtcli.domain.script_line import change_lines
from dvtcli.errors import UsageError
from dvtcli.shell import DvtCommand

if TYPE_CHECKING:
    from dvtcli.domain.plan import Plan
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
    undone = node.history[:] if everything else node.history[-1:]
    applied = node.undo(everything=everything)
    forgotten = not session.dry_run and not applied.findings and _forgotten(session, node.node_id, undone)
    seconds = time.monotonic() - started
    return changed(session, node, applied, seconds, undone=True, lines=[] if forgotten else None)


def _forgotten(session: Session, node_id: int, undone: list[Plan]) -> bool:
    """Leave *undone* out of what `save` writes, where nothing came after it; whether that was so.

    What was stored, or commanded by NMT, in between belongs to what was done: then the undo is a change of its own.
    """
    kept = list(session.executed)
    for plan in reversed(undone):
        if not session.unrecord(node_id, change_lines(plan)):
            session.executed[:] = kept
            return False
    return True
