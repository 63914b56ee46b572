"""Putting changes back: this session's, one that an earlier process made, or to an automatic backup."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.backups import backups, way_to
from dvtcli.device.wish import Wish
from dvtcli.domain.plan import Plan
from dvtcli.domain.script_line import change_lines
from dvtcli.errors import DvtcliError, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.change import changed
from dvtcli.operations.results import ChangedNodes

if TYPE_CHECKING:
    from dvtcli.device.change.journal import Identity
    from dvtcli.device.change.safekeeping import Keeper
    from dvtcli.device.node import Node
    from dvtcli.device.past import Recorded
    from dvtcli.operations.rehearse import Rehearse
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session import Session


def undo(session: Session, *, everything: bool = False) -> Changed | ChangedNodes:
    """Put back what the last change replaced, on whichever node it was; *everything* of this session, last first.

    Where this session changed nothing, the last change that an earlier process made to the node on this bus.
    UsageError where there is none; LeftChanged where the device does not take it.
    """
    order = session.network.order
    if not order:
        return _recorded_put_back(session)
    if not everything:
        return _undone(session, session.node(order[-1]), everything=False)
    return _all_undone(session, list(dict.fromkeys(reversed(order))))


def _all_undone(session: Session, node_ids: list[int]) -> Changed | ChangedNodes:
    """Undo everything on every one of *node_ids*; an error says which nodes were put back before it."""
    done: list[Changed] = []
    try:
        for node_id in node_ids:
            done.append(_undone(session, session.node(node_id), everything=True))  # noqa: PERF401 - kept on an error
    except DvtcliError as error:
        if done:
            error.details.append(("done", f"node {', '.join(str(one.node) for one in done)}: put back before this"))
        raise
    return done[0] if len(done) == 1 else ChangedNodes(tuple(done))


def _undone(session: Session, node: Node, *, everything: bool) -> Changed:
    started = time.monotonic()
    undone = node.history[:] if everything else node.history[-1:]
    applied = node.undo(everything=everything, force=session.options.force)
    forgotten = not session.dry_run and not applied.findings and _forgotten(session, node.node_id, undone)
    seconds = time.monotonic() - started
    return changed(session, node, applied, seconds, undone=True, lines=[] if forgotten else None)


def _recorded_put_back(session: Session) -> Changed:
    """Put back the last change that an earlier process made to the node."""
    keeper = _keeper(session)
    node = session.node(keeper.node_id)
    node.claim()
    identity = node.identity()
    entry = keeper.past.newest(node.node_id, identity) or _moved(session, keeper, identity)
    if entry is None:
        raise _nothing(session, keeper)
    session.tell.note(f"this puts the change of {entry.when[:19].replace('T', ' ')} UTC back")
    started = time.monotonic()
    applied = node.put_back([replace(entry.plan, node_id=node.node_id)], force=session.options.force)
    if not session.dry_run:
        keeper.past.forget(entry)
    return changed(session, node, applied, time.monotonic() - started, undone=True)


def _moved(session: Session, keeper: Keeper, identity: Identity) -> Recorded | None:
    """The last change of the device under another node-ID, unless a device of this *identity* still answers there."""
    entry = keeper.past.moved(keeper.node_id, identity)
    if entry is None:
        return None
    try:
        there = session.open_network().node(entry.plan.node_id).identity()
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return entry
    return None if there == identity else entry  # two devices may well have one serial number


def _keeper(session: Session) -> Keeper:
    """What keeps the selected node's files; where none is selected, of the node that was changed last on this bus."""
    network = session.open_network()
    node_id = session.selected_id()
    if node_id is None and network.guarded:
        entry = network.past().newest_of_all()
        if entry is None:
            raise UsageError("nothing to undo: no change on this bus is remembered")
        node_id = entry.plan.node_id
    keeper = network.node(session.node_id() if node_id is None else node_id).keeper
    if keeper is None:
        raise _nothing(session, None)
    return keeper


def _nothing(session: Session, keeper: Keeper | None) -> UsageError:
    node_id = session.node_id() if keeper is None else keeper.node_id
    error = UsageError("nothing to undo: this session changed nothing on the node", node=node_id)
    last = None if keeper is None else keeper.past.newest_of_all()
    if keeper is not None:
        error.text = f"nothing to undo: no change of node {node_id} is remembered"
    if last is not None:
        error.hint = f"the last change on this bus was one of node {last.plan.node_id}: -n {last.plan.node_id} undo"
    return error


def undo_to_backup(session: Session, rehearse: Rehearse, when: str | None = None) -> Changed:
    """Make the node's PDOs what an automatic backup says, in one transaction: the newest, or one made at *when*.

    *rehearse* finds what the backup, which is a script, wishes. UsageError, with those there are, where none fits.
    """
    keeper = _keeper(session)
    node = session.node(keeper.node_id)
    node.claim()
    file = _backup_file(keeper, node, when)
    session.tell.note(f"this puts {file} back")
    started = time.monotonic()
    wish = rehearse(file, node.node_id).get(node.node_id, Wish())
    if not wish.pdos:
        raise UsageError(
            f"the backup says nothing of a PDO of node {node.node_id}",
            node=node.node_id,
            place=file,
            hint="undo --backup WHEN takes an earlier one",
        )
    changes = way_to({pdo: node.pdo(pdo) for pdo in wish.pdos}, wish.pdos)
    applied = node.apply(Plan(node.node_id, changes), force=session.options.force)
    return changed(session, node, applied, time.monotonic() - started, undone=True)


def _backup_file(keeper: Keeper, node: Node, when: str | None) -> str:
    """The newest backup of the node, or the newest of those made at *when*; UsageError lists what there is."""
    found = backups(keeper.folder / "backups", keeper.bus, node.node_id, node.identity())
    fitting = found if when is None else [one for one in found if one.was_made(when)]
    if fitting:
        return str(fitting[-1].path)
    text = f"no backup of node {node.node_id} was made at {when}" if found else f"no backup of node {node.node_id}"
    error = UsageError(text, node=node.node_id, hint="a backup is made before a process's first change of a node")
    error.details += [("backup", f"{one.stamp}  {one.path}") for one in found]
    raise error


def _forgotten(session: Session, node_id: int, undone: list[Plan]) -> bool:
    """Leave *undone* out of what `save` writes, where nothing came after it; whether that was so.

    What was stored, or commanded by NMT, in between belongs to what was done: then the undo is a change of its own.
    """
    kept = list(session.record.lines)
    for plan in reversed(undone):
        if not session.record.take_back(node_id, change_lines(plan)):
            session.record.lines[:] = kept
            return False
    return True
