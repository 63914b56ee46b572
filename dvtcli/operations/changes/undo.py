"""Undo: the changes of this session, those of earlier processes, or everything since a backup."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from dvtcli.device.change.change_guard import backups, of_this_device, remarks, way_to
from dvtcli.device.change.private_file import unreadable
from dvtcli.device.store.unstored import mark_restored
from dvtcli.device.target_config import TargetConfig
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan
from dvtcli.domain.rules.finding import WARNING, Finding, Rule, warning
from dvtcli.domain.script_line import backup_of, change_lines
from dvtcli.domain.text import all_nodes
from dvtcli.errors import DvtcliError, NoAnswer, Restarted, SafetyRefusal, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.changes.change import change_result
from dvtcli.operations.results import Changed, ChangedNodes

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Applied
    from dvtcli.device.change.change_group import OrderedChange
    from dvtcli.device.change.change_guard import ChangeGuard
    from dvtcli.device.change.change_history import ChangeHistory, ChangeHistoryEntry
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.operations.changes.network_phases import NodeUndo
    from dvtcli.operations.session.session import Rehearse, Session, SessionNodes
    from dvtcli.operations.user.change_files import ChangeFiles
    from dvtcli.operations.user.session_user import SessionUser

T = TypeVar("T")


def undo(session: Session, *, everything: bool = False) -> Changed | ChangedNodes:
    """Undo the last change of this session, or with *everything* all of them, on every node.

    A change made on several nodes together, as by `apply`, is undone on all of them, or on the node given by -n.
    If there is none, or all are undone, changes of earlier processes are undone: of the selected node with the changes
    made together with it, or of every node on the bus if none is selected. Several nodes are undone together, phase by
    phase, all or none, unless a node is expected to refuse its old value. Raises SafetyRefusal if a device holds
    another value than the change left; an error names the nodes undone before it.
    """
    from dvtcli.operations.changes.network_phases import may_go_together, undo_together

    order = session.network.change_order
    if not order:
        remembered_devices = remembered(session, everything=everything)
        together = [undoing(session, remembered_device) for remembered_device in remembered_devices]
        if may_go_together(together):
            return ChangedNodes(undo_together(session, together))
        entirely = everything or len(remembered_devices) > 1
        return _one_by_one(
            session,
            remembered_devices,
            lambda remembered_device: undo_remembered_changes(session, remembered_device, everything=entirely),
        )
    counts = (
        Counter(change.node_id for change in reversed(order)) if everything else _last_counts(order, session.group.id)
    )
    given = _given_node(session)
    if not everything and given is not None and given in counts and len(counts) > 1:
        undone = _own_undone(session, given, 1)
        others = all_nodes(sorted(counts.keys() - {given}))
        why = f"the same change on {others} is not undone by this: another {{}} undoes it"
        session.reporter.warning(Hint(Action.UNDO, why=why))
        return undone
    together = [_undoing(session, session.node(node_id), count) for node_id, count in counts.items()]
    if may_go_together(together):
        return ChangedNodes(undo_together(session, together))
    return _one_by_one(session, counts, lambda node_id: _own_undone(session, node_id, counts[node_id]))


def _last_counts(order: Sequence[OrderedChange], present: str | None) -> Mapping[int, int]:
    """Count the plans of the last change in *order* by node-ID: of its whole group if that is on several nodes.

    Of the group *present*, an atomic script that still runs, only the last plan is counted.
    """
    group_id = order[-1].group_id
    if group_id not in (None, present):
        ended = takewhile(lambda change: change.group_id == group_id, reversed(order))
        if len(counts := Counter(change.node_id for change in ended)) > 1:
            return counts
    return {order[-1].node_id: 1}


def _given_node(session: SessionNodes) -> int | None:
    """Return the node-ID given by -n or `node ID`; None for none, several, or the first simulated node."""
    return session.base.one_node if session.selected is None else session.selected


def undo_on(session: SessionNodes, node_id: int, *, everything: bool = False) -> Changed:
    """Undo the last change of a single node, or with *everything* all; of this session, else as `undo`."""
    if history := session.node(node_id).history:
        return _own_undone(session, node_id, len(history) if everything else 1)

    return undo_remembered_changes(
        session, remembered_of(session, node_id, everything=everything), everything=everything
    )


def _one_by_one(session: SessionNodes, things: Iterable[T], undo_one: Callable[[T], Changed]) -> Changed | ChangedNodes:
    """Undo *things* one after another; an error names the nodes undone before it.

    Raises Restarted if a node restarted while another was undone.
    """
    done: list[Changed] = []
    again: list[int] = []
    boot_ups: dict[int, int] = {}
    try:
        for thing in things:
            done.append(one := undo_one(thing))
            boot_ups[one.node] = session.bus.boot_ups(one.node)
        again += [node_id for node_id, seen in boot_ups.items() if session.bus.boot_ups(node_id) != seen]
        if again:
            raise Restarted(
                f"{all_nodes(again)} restarted after the roll-back: unstored values are lost",
                hint=Hint(Action.SHOW_PDOS, why="check its supply, then its values with {}"),
                state="unknown",
            )
    except DvtcliError as error:
        error.beside([undone.node for undone in done if undone.node not in again], [error], "rolled back before this")
        error.nodes |= dict.fromkeys(again, "unknown")
        raise
    return done[0] if len(done) == 1 else ChangedNodes(tuple(done))


def _undoing(session: SessionNodes, node: Node, count: int) -> NodeUndo:
    """Collect the newest *count* changes of this session on *node* for an undo."""
    from dvtcli.operations.changes.network_phases import NodeUndo

    def forget(applied: Applied, count: int) -> list[str] | None:
        before = node.history[:]
        node.was_undone(applied, count)
        as_before = not applied.findings
        forgotten = not session.dry_run and as_before and _forgotten(session, node.node_id, before[-count:])
        return [] if forgotten else None

    return NodeUndo(node, tuple(node.history[-count:]), True, forget)


def _own_undone(session: SessionNodes, node_id: int, count: int) -> Changed:
    """Undo the newest *count* changes of this session on a node, or those left if a reset has undone more."""
    started, node = time.monotonic(), session.node(node_id)
    before = node.history[:]
    applied = node.undo(count=count, force=session.options.force)
    undone = before[len(node.history) :]
    as_before = not (applied.findings or applied.not_put_back)
    forgotten = not session.dry_run and as_before and _forgotten(session, node.node_id, undone)
    seconds = time.monotonic() - started
    return change_result(session, node, applied, seconds, undone=True, lines=[] if forgotten else None)


def _forgotten(session: SessionNodes, node_id: int, undone: list[Plan]) -> bool:
    """Drop *undone* from what `save` writes if nothing came after it; returns whether it did.

    After a store or an NMT command the undo is saved as a change of its own.
    """
    kept = list(session.record.lines)
    for plan in reversed(undone):
        if not session.record.remove_last(node_id, change_lines(plan)):
            session.record.lines[:] = kept
            return False
    return True


RULES = (Rule("newer-change", WARNING, "`undo` of one node: another node of the bus was changed later", "ours"),)


@dataclass(frozen=True, slots=True)
class RememberedDevice:
    """The remembered changes of a device that is present, oldest first; its node is locked."""

    node: Node
    guard: ChangeGuard
    entries: list[ChangeHistoryEntry]
    #: findings to report along
    findings: tuple[Finding, ...] = ()


def remembered(session: SessionNodes, *, everything: bool) -> list[RememberedDevice]:
    """Find remembered changes of earlier processes to undo, latest device first.

    Covers the selected node and the changes made from it, the nodes given by -n, or all nodes on the bus; *everything*
    takes all these devices. Otherwise it is the last change, on all nodes if it was made on several together. Raises
    UsageError if nothing is remembered, or if a command of this session changed nothing.
    """
    selected, change_files = session.selected_id(), session.open_network().change_files
    if change_files is None:
        raise _nothing_kept(session.node(session.node_id()))
    if not everything:
        _refuse_in_vain(session.network.nodes.values())
    remembered_devices = _remembered_devices(session, change_files, selected, only_newest=not everything)
    if not remembered_devices:
        raise nothing_remembered(change_files, selected)
    if selected is None and not everything:
        remembered_devices = _with_group(session, change_files, remembered_devices[0])
    newer = () if selected is None else _newer_elsewhere(remembered_devices[0].guard.history, remembered_devices)
    return [replace(remembered_device, findings=newer) for remembered_device in remembered_devices]


def remembered_of(session: SessionNodes, node_id: int, *, everything: bool) -> RememberedDevice:
    """Find remembered changes of earlier processes on a node; raises UsageError if there is none."""
    change_files = session.open_network().change_files
    if change_files is None:
        raise _nothing_kept(session.node(node_id))
    if not everything:
        _refuse_in_vain([session.node(node_id)])
    remembered_device = _remembered_device(session, node_id, node_id)
    if remembered_device is None:
        raise nothing_remembered(change_files, node_id)
    return replace(remembered_device, findings=_newer_elsewhere(remembered_device.guard.history, [remembered_device]))


def _refuse_in_vain(nodes: Iterable[Node]) -> None:
    """Raises UsageError once per command of this session without a change: an undo of it must not hit older changes."""
    for node in nodes:
        if node.unchanged_commands:
            node.unchanged_commands -= 1
            raise UsageError(
                f"nothing to undo: a command of this session changed nothing on node {node.node_id}",
                node=node.node_id,
                hint=Hint(Action.UNDO, why="repeat it to undo the changes of earlier commands"),
            )


def _nothing_kept(node: Node) -> UsageError:
    """Make the error if there is nothing to undo on *node*, whose changes are remembered by this session only."""
    done = "every change of this session is undone" if node.undid_own else "this session changed nothing on the node"
    return UsageError(f"nothing to undo: {done}", node=node.node_id)


def undo_remembered_changes(session: SessionNodes, remembered_device: RememberedDevice, *, everything: bool) -> Changed:
    """Undo the last change of *remembered_device*, or *everything*.

    Raises SafetyRefusal if the device has other values.
    """
    from dvtcli.device.change.undo_plan import UndoRequest

    started, node = time.monotonic(), remembered_device.node
    applied, count = node.undo_plans(
        UndoRequest(_plans(remembered_device), everything=everything, force=session.options.force)
    )
    _forget(session, remembered_device, applied, count)
    if not everything:
        group_id = remembered_device.entries[-1].group_id
        history = remembered_device.guard.history
        parts = [entry for entry in history.tops(None) if group_id and entry.group_id == group_id]
        if others := {entry.plan.node_id for entry in parts} - {node.node_id}:
            why = f"the same change on {all_nodes(sorted(others))} is not undone by this: {{}} undoes it"
            session.reporter.warning(Hint(Action.UNDO, {"node": tuple(sorted(others))}, why))
        elif others := {entry.plan.node_id for entry in history.tops(session.selected_id())} - {node.node_id}:
            why = f"the changes on {all_nodes(sorted(others))} are not undone by this: {{}} undoes them all"
            session.reporter.note(Hint(Action.UNDO, {"all": True}, why))
    applied = applied._replace(findings=(*applied.findings, *remembered_device.findings))
    return change_result(session, node, applied, time.monotonic() - started, undone=True)


def _warn_of_left_out(session: SessionUser, others: Collection[int]) -> None:
    """Warn of nodes with changes to undo that -n leaves out."""
    if others:
        session.reporter.warning(f"the changes on {all_nodes(sorted(others))} stay: other nodes are selected")


def undoing(session: SessionUser, remembered_device: RememberedDevice) -> NodeUndo:
    """Collect all changes of *remembered_device*, to undo together with other nodes."""
    from dvtcli.device.change.undo_plan import unbroken
    from dvtcli.operations.changes.network_phases import NodeUndo

    def forget(applied: Applied, count: int) -> None:
        _forget(session, remembered_device, applied, count)
        remembered_device.node.undone_earlier += 1

    return NodeUndo(
        remembered_device.node, tuple(unbroken(_plans(remembered_device))), False, forget, remembered_device.findings
    )


def _plans(remembered_device: RememberedDevice) -> list[Plan]:
    return [replace(entry.plan, node_id=remembered_device.node.node_id) for entry in remembered_device.entries]


def _forget(session: SessionUser, remembered_device: RememberedDevice, applied: Applied, count: int) -> None:
    """Drop the newest *count* entries of *remembered_device*, undone by *applied*."""
    undone = remembered_device.entries[-count:]
    session.reporter.note(
        _undone_text(undone, remembered_device.node.node_id, gone=count > 1 and not len(applied.plan))
    )
    if not session.dry_run:
        remembered_device.guard.history.drop_entries(undone, applied.plan)
        mark_restored(remembered_device.node, remembered_device.node.history, applied)


def _remembered_devices(
    session: SessionNodes, change_files: ChangeFiles, selected: int | None, *, only_newest: bool
) -> list[RememberedDevice]:
    """Find the chosen changes, the latest device first."""
    found: list[RememberedDevice] = []
    ids = dict.fromkeys(entry.plan.node_id for entry in change_files.history().tops(selected))
    if given := session.base.nodes if selected is None else ():
        if not only_newest:
            _warn_of_left_out(session, ids.keys() - set(given))
        ids = {node_id: None for node_id in ids if node_id in given}
    for node_id in [*ids, *([] if selected is None or selected in ids else [selected])]:
        with _hinting_at_others(node_id, ids.keys() - {node_id}, everything=not only_newest):
            remembered_device = _remembered_device(session, node_id, selected)
        if remembered_device is not None:
            found.append(remembered_device)
            if only_newest:
                break
    return found


def _with_group(session: SessionNodes, change_files: ChangeFiles, last: RememberedDevice) -> list[RememberedDevice]:
    """Return *last* and the devices that still have changes of the same group, each with these changes only.

    Returns *last* as it is if there is no other.
    """
    group_id = last.entries[-1].group_id
    tops = change_files.history().tops(None) if group_id else []
    ids = dict.fromkeys(entry.plan.node_id for entry in tops if entry.group_id == group_id)
    if given := session.base.nodes:
        _warn_of_left_out(session, ids.keys() - set(given))
    devices = [last]
    for node_id in ids:
        if node_id != last.node.node_id and (not given or node_id in given):
            with _hinting_at_others(node_id, ids.keys() - {node_id}, everything=False):
                device = _remembered_device(session, node_id, None)
            devices += [device] if device is not None and device.entries[-1].group_id == group_id else []
    return devices if len(devices) == 1 else [_of_group(device, group_id) for device in devices]


def _of_group(device: RememberedDevice, group_id: str) -> RememberedDevice:
    entries = list(takewhile(lambda entry: entry.group_id == group_id, reversed(device.entries)))
    return replace(device, entries=entries[::-1])


@contextmanager
def _hinting_at_others(node_id: int, others: Collection[int], *, everything: bool) -> Iterator[None]:
    """If the node does not answer, add the hint that leaves it out: the undo of the *others*."""
    try:
        yield
    except NoAnswer as silent:
        if others:
            chosen = {"node": tuple(sorted(others)), **({"all": True} if everything else {})}
            hint = Hint(Action.UNDO, chosen, f"{{}} leaves node {node_id} out")
            silent.hint = hint + silent.hint if silent.hint else hint
        raise


def _remembered_device(session: SessionNodes, node_id: int, selected: int | None) -> RememberedDevice | None:
    """Find the chosen changes of the device at *node_id*; None if there is none."""
    guard = session.open_network().node(node_id).guard
    assert guard is not None  # noqa: S101 - its changes are kept
    node = session.node(node_id)
    node.begin_change()
    identity = node.identity()
    entries = guard.history.entries(node_id, identity, selected)
    if not entries and node_id == selected:
        entries = _moved(session, guard, identity)
        if entries:
            was = entries[-1].plan.node_id
            session.reporter.note(
                f"node {node_id} was node {was} when it was changed: values that depend on the node-ID, such as "
                f"COB-IDs, may differ"
            )
    return RememberedDevice(node, guard, entries) if entries else None


def _moved(session: SessionNodes, guard: ChangeGuard, identity: Identity) -> list[ChangeHistoryEntry]:
    """List the device's changes under another node-ID, unless a device with this *identity* answers there."""
    entry = guard.history.moved(guard.node_id, identity)
    if entry is None:
        return []
    was = entry.plan.node_id
    try:
        there = session.open_network().node(was).identity()
    except (NoAnswer, SdoAborted, SdoProtocolError):
        there = {}
    # two devices may have the same serial number
    return [] if there == identity else guard.history.entries(was, identity, None)


def _newer_elsewhere(history: ChangeHistory, remembered_devices: list[RememberedDevice]) -> tuple[Finding, ...]:
    """Warn if another node of the bus was changed later than the chosen nodes."""
    last = history.newest_of_all()
    if last is None or last.order <= max(
        remembered_device.entries[-1].order for remembered_device in remembered_devices
    ):
        return ()
    hint = Hint(Action.UNDO, {"node": last.plan.node_id}, "undoes that")
    text = f"node {last.plan.node_id} was changed later, at {_time(last)}"
    return (warning("newer-change", f"node {last.plan.node_id}", text, hint),)


def _undone_text(undone: list[ChangeHistoryEntry], node_id: int, *, gone: bool) -> str:
    since = _time(undone[0])
    if gone:
        what = f"what was before the last {len(undone)} changes of node {node_id}, since {since},"
        return f"{what} is already the case, as after a reset"
    return (
        f"this undoes the change of {since} to node {node_id}"
        if len(undone) == 1
        else (f"this undoes the {len(undone)} changes since {since} to node {node_id}")
    )


def _time(entry: ChangeHistoryEntry) -> str:
    return f"{entry.when[:19].replace('T', ' ')} UTC"


def nothing_remembered(change_files: ChangeFiles, selected: int | None) -> UsageError | SafetyRefusal:
    """Make the error if there is nothing to undo on the *selected* node or the bus, or if that is unknown."""
    if (unread := unreadable(change_files.history().folder)) is not None:
        unread.why = "the history of changes is kept there: it is unknown whether there is a change to undo"
        return unread
    others = sorted({top.plan.node_id for top in change_files.history().tops(None)})
    if selected is None and others:
        return UsageError(
            f"nothing to undo: the history has no change of the devices that are now {all_nodes(others)}",
            why="the remembered changes of these node-IDs are of other devices (0x1018)",
            hint=Hint(Action.UNDO, {"node": "ID"}, "if they have other node-IDs now: {}"),
        )
    if selected is None:
        return UsageError("nothing to undo: the history has no change on this bus")
    error = UsageError(f"nothing to undo: the history has no change of node {selected}", node=selected)
    last = change_files.history().newest_of_all()
    if last is not None:
        error.hint = Hint(
            Action.UNDO,
            {"node": last.plan.node_id},
            f"the last change on this bus was of node {last.plan.node_id}: {{}}",
        )
    return error


def undo_to_backup(session: SessionNodes, rehearse: Rehearse, when: str | None = None) -> Changed:
    """Set the node's PDOs to an automatic backup in one transaction: the newest, or the backup of *when*.

    *rehearse* evaluates the backup, which is a script. Raises UsageError with the available backups if none fits.
    """
    guard = _change_guard(session)
    node = session.node(guard.node_id)
    initial_state = node.begin_change()
    file = _backup_file(guard, node, when, force=session.options.force)
    session.reporter.note(f"this puts {file} back")
    said = remarks(Path(file))
    for remark in said:
        session.reporter.warning(f"not undone completely: {remark}")
    started = time.monotonic()
    config = rehearse(file, node.node_id).get(node.node_id, TargetConfig())
    if not config.pdos:
        raise UsageError(
            f"the backup has no PDO of node {node.node_id}",
            node=node.node_id,
            place=file,
            hint=Hint(Action.UNDO, {"backup": True, "when": "WHEN"}, "uses an earlier backup"),
        )
    changes = way_to(node.observed(lambda: {pdo: node.pdo(pdo) for pdo in config.pdos}), config.pdos)
    applied = node.apply(Plan(node.node_id, changes), force=session.options.force, initial_state=initial_state)
    applied = applied._replace(not_put_back=tuple(_unlike_backup(node, said)))
    return change_result(session, node, applied, time.monotonic() - started, undone=True)


def _change_guard(session: SessionNodes) -> ChangeGuard:
    """Return the guard of the selected node's files, or of the node last changed on this bus."""
    network = session.open_network()
    node_id = session.selected_id()
    if node_id is None and network.change_files is not None:
        entry = network.change_files.history().newest_of_all()
        if entry is None:
            error = nothing_remembered(network.change_files, None)
            error.hint = Hint(Action.UNDO, {"node": "ID", "backup": True}, "{} puts the newest backup of a node back")
            raise error
        node_id = entry.plan.node_id
    guard = network.node(session.node_id() if node_id is None else node_id).guard
    if guard is None:
        raise UsageError(
            f"no backup of node {node_id or session.node_id()}: it is simulated in this process, for which no "
            f"backups are made",
            node=node_id or session.node_id(),
            hint=Hint(Action.UNDO, why="reverts the last change")
            + Hint(Action.UNDO, {"all": True}, ", {} all changes of this session")
            if session.record.lines
            else None,
        )
    return guard


def _unlike_backup(node: ReadableNode, said: Iterable[str]) -> Iterator[Finding]:
    """Report differing PDOs that a backup cannot restore (*said*: remarks of the backup)."""
    for remark in said:
        pdo = Pdo.parse(remark.split()[0])
        if f"# {remark}" not in backup_of(pdo, node.pdo(pdo)):
            text = f"{pdo.label} is not undone completely: {remark}"
            yield warning("way-back", f"0x{pdo.communication_index:04X}:01", text)


def _backup_file(guard: ChangeGuard, node: ReadableNode, when: str | None, *, force: bool) -> str:
    """Find the newest backup of the device, or of those made at *when*; UsageError lists the backups.

    Raises SafetyRefusal if the backups of its node-ID are of another device of its kind, unless *force* accepts them.
    """
    kind = backups(guard.folder / "backups", guard.bus, node.node_id, node.identity())
    found = kind if force else of_this_device(kind, node.identity())
    if kind and not found:
        other = SafetyRefusal(
            f"no backup of the device that is now node {node.node_id}: the backups for this node-ID are of another "
            f"device",
            node=node.node_id,
            why="its serial number (0x1018:04) differs",
            hint=Hint(Action.FORCE, why="writes such a backup to a spare device"),
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
