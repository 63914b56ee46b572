"""Undo to an automatic backup: all its PDOs in one transaction.

The caller finds what the backup's lines request.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.change.backups import backups, of_this_device, remarks, way_to
from dvtcli.device.wish import Wish
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan
from dvtcli.domain.rules.finding import Finding, warning
from dvtcli.domain.script_line import backup_of
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.operations.changes.change import changed
from dvtcli.operations.changes.undo_remembered import nothing_remembered
from dvtcli.operations.results import Changed

if TYPE_CHECKING:
    from dvtcli.device.change.change_guard import ChangeGuard
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.operations.session.session import Rehearse
    from dvtcli.operations.session.session_nodes import SessionNodes


def undo_to_backup(session: SessionNodes, rehearse: Rehearse, when: str | None = None) -> Changed:
    """Set the node's PDOs to an automatic backup in one transaction: the newest, or the backup of *when*.

    *rehearse* evaluates the backup, which is a script. Raises UsageError with the available backups if none fits.
    """
    keeper = _keeper(session)
    node = session.node(keeper.node_id)
    found = node.begin_change()
    file = _backup_file(keeper, node, when, force=session.options.force)
    session.tell.note(f"this puts {file} back")
    said = remarks(Path(file))
    for remark in said:
        session.tell.warning(f"not undone completely: {remark}")
    started = time.monotonic()
    wish = rehearse(file, node.node_id).get(node.node_id, Wish())
    if not wish.pdos:
        raise UsageError(
            f"the backup says nothing of a PDO of node {node.node_id}",
            node=node.node_id,
            place=file,
            hint=Hint(Action.UNDO, {"backup": True, "when": "WHEN"}, "takes an earlier one"),
        )
    changes = way_to(node.observed(lambda: {pdo: node.pdo(pdo) for pdo in wish.pdos}), wish.pdos)
    applied = node.apply(Plan(node.node_id, changes), force=session.options.force, found=found)
    applied = replace(applied, not_put_back=tuple(_unlike_backup(node, said)))
    return changed(session, node, applied, time.monotonic() - started, undone=True)


def _keeper(session: SessionNodes) -> ChangeGuard:
    """Return the guard of the selected node's files, or of the node last changed on this bus."""
    network = session.open_network()
    node_id = session.selected_id()
    if node_id is None and network.keeping is not None:
        entry = network.keeping.past().newest_of_all()
        if entry is None:
            error = nothing_remembered(network.keeping, None)
            error.hint = Hint(Action.UNDO, {"node": "ID", "backup": True}, "{} puts the newest backup of a node back")
            raise error
        node_id = entry.plan.node_id
    keeper = network.node(session.node_id() if node_id is None else node_id).keeper
    if keeper is None:
        raise UsageError(
            f"no backup of node {node_id or session.node_id()}: it is simulated in this process, which makes none",
            node=node_id or session.node_id(),
            hint=Hint(Action.UNDO, why="puts the last change back")
            + Hint(Action.UNDO, {"all": True}, ", {} all that this session changed")
            if session.record.lines
            else None,
        )
    return keeper


def _unlike_backup(node: ReadableNode, said: Iterable[str]) -> Iterator[Finding]:
    """Report differing PDOs that a backup cannot restore (*said*: remarks of the backup)."""
    for remark in said:
        pdo = Pdo.parse(remark.split()[0])
        if f"# {remark}" not in backup_of(pdo, node.pdo(pdo)):
            text = f"{pdo.label} is not undone completely: {remark}"
            yield warning("way-back", f"0x{pdo.communication_index:04X}:01", text)


def _backup_file(keeper: ChangeGuard, node: ReadableNode, when: str | None, *, force: bool) -> str:
    """Find the newest backup of the device, or of those made at *when*; UsageError lists the backups.

    Raises SafetyRefusal if the backups of its node-ID are of another device of its kind, unless *force* accepts them.
    """
    kind = backups(keeper.folder / "backups", keeper.bus, node.node_id, node.identity())
    found = kind if force else of_this_device(kind, node.identity())
    if kind and not found:
        other = SafetyRefusal(
            f"no backup of the device that is node {node.node_id} now: those of this node-ID are another device's",
            node=node.node_id,
            why="its serial number (0x1018:04) is another one",
            hint=Hint(Action.FORCE, why="writes one all the same, to a spare device that takes its place"),
        )
        other.details += [("backup", f"{backup.stamp}  {backup.path}") for backup in kind]
        raise other
    fitting = found if when is None else [backup for backup in found if backup.was_made(when)]
    if fitting:
        return str(fitting[-1].path)
    text = f"no backup of node {node.node_id} was made at {when}" if found else f"no backup of node {node.node_id}"
    error = UsageError(text, node=node.node_id, hint="a backup is made before dvtcli's first change of a device")
    error.details += [("backup", f"{backup.stamp}  {backup.path}") for backup in found]
    raise error
