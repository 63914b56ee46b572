"""Finishing a change that was interrupted: from its journal, or by taking what the device holds."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.device.applied import Applied
from dvtcli.device.change import way_back
from dvtcli.device.change.journal import ACCEPTED, DISCARDED, Journals, read_journal
from dvtcli.device.change.pending import CHANGE
from dvtcli.domain.several import several
from dvtcli.errors import InputFileError, SafetyRefusal, UsageError
from dvtcli.operations.change import changed
from dvtcli.operations.options import is_file
from dvtcli.operations.results import Facts

if TYPE_CHECKING:
    from dvtcli.device.change.journal import Journal
    from dvtcli.device.node import Node
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session import Session


def recover(
    session: Session, file: str | None = None, *, accept: bool = False, discard: bool = False
) -> Changed | Facts:
    """Put back what the interrupted change of the selected node replaced, from its journal or the one in *file*.

    *accept* takes what the device holds as the new state and writes nothing; *discard* sets a journal that cannot be
    used aside. SafetyRefusal for a journal of another bus or device, LeftChanged where the device does not take it.
    """
    if accept and discard:
        raise UsageError("--accept and --discard exclude each other")
    path = _path(session, file)
    if path is None:
        said = "nothing to recover: no change of this node was interrupted"
        return Facts("recover", (("node", session.node_id()), ("recovered", False)), (said,))
    if discard:
        return _discarded(session, path)
    journal = read_journal(path)
    node = session.node(journal.plan.node_id)
    if journal.bus != session.wire.name and not session.options.force:
        raise SafetyRefusal(
            f"the journal was made on another bus: {journal.bus}, not {session.wire.name}",
            node=node.node_id,
            place=str(journal.path),
            hint="attach to that bus, or --force if it is the same one under another name",
        )
    return _accepted(session, node, journal) if accept else _recovered(session, node, journal)


def _path(session: Session, file: str | None) -> Path | None:
    """The journal that is meant, whether it can be read or not; None where no change was interrupted."""
    if file is not None:
        if not is_file(file):
            raise UsageError(f"{file}: no such file", place=file, hint="recover alone takes the node's own journal")
        return _held_file(session, Path(file))
    keeper = session.open_network().node(session.node_id()).keeper
    if keeper is not None:
        return keeper.open_journal() if session.dry_run else keeper.held_journal()
    path = Journals(session.state_folder / "journals", session.wire.name).path(session.node_id())
    return path if path.exists() else None


def _held_file(session: Session, path: Path) -> Path | None:
    """The journal at *path* once no other dvtcli is at work on its node; None where it is gone by then."""
    network = session.open_network()
    try:
        journal = read_journal(path)
    except InputFileError:  # whoever reads it says so; `recover --discard` sets it aside under the lock
        return path if path.exists() else None
    if session.dry_run or journal.bus != network.bus.name:
        return path  # of another bus nobody here is at work on its node, which need not be on this one
    keeper = network.node(journal.plan.node_id).keeper
    if keeper is not None:
        keeper.hold()
    return path if path.exists() else None


def _recovered(session: Session, node: Node, journal: Journal) -> Changed:
    labels = several(change.label for change in journal.plan.changes)
    session.consent(f"{labels} of node {node.node_id} will be put back as before the interrupted change; recover?")
    started = time.monotonic()
    plan = way_back.recover(node, journal)
    unknown = way_back.unknown_before([journal.plan])
    return changed(session, node, Applied(plan, unknown), time.monotonic() - started, undone=True)


def _accepted(session: Session, node: Node, journal: Journal) -> Facts:
    """Close *journal* with what *node* holds now, which is shown beside what it held and was to hold."""
    way_back.refuse_other_device(node, journal)
    states = way_back.accepted_states(node, journal)
    kept = None if session.dry_run else _set_aside(session, journal.path, node.node_id, ACCEPTED)
    if kept is not None:
        node.pending.suspicions.pop(CHANGE, None)
    text = [
        f"{name:<11} {line}" for one in states for name, line in (("holds now", one.held), ("held before", one.before))
    ]
    said = f"node {node.node_id}: what it holds now is the new state; the journal is kept as {kept}"
    rows: tuple[tuple[str, Any], ...] = (
        ("node", node.node_id),
        ("recovered", False),
        ("accepted", kept is not None),
        ("kept", None if kept is None else str(kept)),
        ("held", [one.document() for one in states]),
    )
    return Facts("recover", rows, (*text, said if kept is not None else "dry run: the journal stays"))


def _discarded(session: Session, path: Path) -> Facts:
    """Set the journal at *path* aside unless it can be used; a usable one only with --force."""
    node_id = _useless_for(session, path)
    kept = None if session.dry_run else _set_aside(session, path, node_id, DISCARDED)
    rows = (
        ("node", node_id),
        ("recovered", False),
        ("discarded", kept is not None),
        ("kept", None if kept is None else str(kept)),
    )
    said = f"the journal is kept as {kept}; look at the node with `pdo`, and set it as it should be"
    return Facts("recover", rows, (said if kept is not None else "dry run: the journal stays",))


def _useless_for(session: Session, path: Path) -> int:
    """The node whose writing the journal at *path* blocks; SafetyRefusal where the journal could be used."""
    try:
        journal = read_journal(path)
    except InputFileError:
        return session.node_id()
    node_id = journal.plan.node_id
    bus = session.open_network().bus.name
    if not session.options.force and journal.bus == bus and journal.identity == session.node(node_id).identity():
        raise SafetyRefusal(
            f"the journal of node {node_id} can be used: it is not set aside",
            node=node_id,
            place=str(path),
            hint="recover puts the old configuration back, recover --accept takes what the device holds; "
            "--force sets it aside all the same",
        )
    return session.node_id() if session.selected_id() is not None else node_id


def _set_aside(session: Session, path: Path, node_id: int, word: str) -> Path:
    keeper = session.open_network().node(node_id).keeper
    if keeper is None:
        raise UsageError("a node of this process has no journal: attach to the bus that it was made on")
    return keeper.set_aside(path, word)
