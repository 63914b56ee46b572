"""Finish an interrupted change: put the old configuration back from its journal."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.commands._changing import changed
from dvtcli.options import is_file
from dvtcli.params import FILE
from dvtcli.shell import DvtCommand

if TYPE_CHECKING:
    from dvtcli.device.journal import Journal
    from dvtcli.results import Changed, Facts
    from dvtcli.session import Session


@click.command("recover", cls=DvtCommand, short_help=__doc__)
@click.argument("file", type=FILE, required=False)
@click.pass_obj
def command(session: Session, /, file: str | None) -> Changed | Facts:
    """Read the node, put back what the interrupted change replaced, and verify it.

    \b
    recover
    recover --dry-run          shows what would be written
    recover can0-5.json        a journal that was kept elsewhere
    """
    from dvtcli.device.back import recover, unknown_before
    from dvtcli.device.node import Applied
    from dvtcli.domain.several import several
    from dvtcli.errors import SafetyRefusal
    from dvtcli.results import Facts

    journal = _journal(session, file)
    if journal is None:
        said = "nothing to recover: no change of this node was interrupted"
        return Facts("recover", (("node", session.node_id()), ("recovered", False)), (said,))
    node = session.node(journal.plan.node_id)
    if journal.bus != session.wire.name and not session.options.force:
        raise SafetyRefusal(
            f"the journal was made on another bus: {journal.bus}, not {session.wire.name}",
            node=node.node_id,
            place=str(journal.path),
            hint="attach to that bus, or --force if it is the same one under another name",
        )
    labels = several(change.label for change in journal.plan.changes)
    session.consent(f"{labels} of node {node.node_id} will be put back as before the interrupted change; recover?")
    started = time.monotonic()
    plan = recover(node, journal)
    unknown = unknown_before([journal.plan])
    return changed(session, node, Applied(plan, unknown), time.monotonic() - started, undone=True)


def _journal(session: Session, file: str | None) -> Journal | None:
    from dvtcli.device.journal import Journals, read_journal
    from dvtcli.errors import UsageError

    if file is None:
        keeper = session.node().keeper
        path = keeper.open_journal() if keeper is not None else None
        if path is None:  # a twin has no keeper of its own
            return Journals(session.state_folder / "journals", session.wire.name).find(session.node_id())
        return read_journal(path)
    if not is_file(file):
        raise UsageError(f"{file}: no such file", place=file, hint="recover alone takes the node's own journal")
    return read_journal(Path(file))
