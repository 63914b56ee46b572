"""Undo remembered changes of earlier processes on the devices present.

`device.change.undo_plan` decides what a device must hold for an undo.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dvtcli.device.change.private_file import unreadable
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.rules.finding import WARNING, Finding, Rule, warning
from dvtcli.errors import NoAnswer, SafetyRefusal, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.changes.change import changed
from dvtcli.operations.results import Changed

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dvtcli.device.change.applied import Applied
    from dvtcli.device.change.change_guard import ChangeGuard
    from dvtcli.device.change.change_history import ChangeHistory, ChangeHistoryEntry
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Plan
    from dvtcli.operations.changes.undo_together import Undoing
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.keeping import Keeping
    from dvtcli.operations.user.session_user import SessionUser

RULES = (Rule("newer-change", WARNING, "`undo` of one node: another one of the bus was changed later", "ours"),)


@dataclass(frozen=True, slots=True)
class RememberedDevice:
    """The remembered changes of a device that is present, oldest first; its node is locked."""

    node: Node
    keeper: ChangeGuard
    entries: list[ChangeHistoryEntry]
    #: findings to report along
    findings: tuple[Finding, ...] = ()


def remembered(session: SessionNodes, *, everything: bool) -> list[RememberedDevice]:
    """Find remembered changes of earlier processes to undo, latest device first.

    Covers the selected node and the changes made from it, or all nodes on the bus if none is selected; *everything*
    takes all these devices. Raises UsageError if nothing is remembered, or if a command of this session changed
    nothing.
    """
    selected, keeping = session.selected_id(), session.open_network().keeping
    if keeping is None:
        raise _nothing_kept(session.node_id())
    if not everything:
        _refuse_in_vain(session.network.nodes.values())
    chains = _chains(session, keeping, selected, only_newest=not everything)
    if not chains:
        raise nothing_remembered(keeping, selected)
    newer = () if selected is None else _newer_elsewhere(chains[0].keeper.past, chains)
    return [replace(chain, findings=newer) for chain in chains]


def remembered_of(session: SessionNodes, node_id: int, *, everything: bool) -> RememberedDevice:
    """Find remembered changes of earlier processes on a node; raises UsageError if there is none."""
    keeping = session.open_network().keeping
    if keeping is None:
        raise _nothing_kept(node_id)
    if not everything:
        _refuse_in_vain([session.node(node_id)])
    chain = _chain(session, node_id, node_id)
    if chain is None:
        raise nothing_remembered(keeping, node_id)
    return replace(chain, findings=_newer_elsewhere(chain.keeper.past, [chain]))


def _refuse_in_vain(nodes: Iterable[Node]) -> None:
    """Raises UsageError once per command of this session without a change: an undo of it must not hit older changes."""
    for node in nodes:
        if node.in_vain:
            node.in_vain -= 1
            raise UsageError(
                f"nothing to undo: a command of this session changed nothing on node {node.node_id}",
                node=node.node_id,
                hint=Hint(Action.UNDO, why="once more goes on to what earlier commands changed"),
            )


def _nothing_kept(node_id: int) -> UsageError:
    return UsageError("nothing to undo: this session changed nothing on the node", node=node_id)


def undo_remembered_changes(session: SessionNodes, chain: RememberedDevice, *, everything: bool) -> Changed:
    """Undo the last change of *chain*, or *everything*; raises SafetyRefusal if the device has other values."""
    from dvtcli.device.change.undo_plan import UndoRequest

    started, node = time.monotonic(), chain.node
    applied, count = node.undo_plans(UndoRequest(_plans(chain), everything=everything, force=session.options.force))
    _forget(session, chain, applied, count)
    if not everything:
        _tell_of_others(session, chain)
    applied = replace(applied, findings=(*applied.findings, *chain.findings))
    return changed(session, node, applied, time.monotonic() - started, undone=True)


def _tell_of_others(session: SessionNodes, chain: RememberedDevice) -> None:
    """Report the chosen nodes that keep their changes: a single change is on a single node."""
    tops = chain.keeper.past.tops(session.selected_id())
    others = sorted({entry.plan.node_id for entry in tops} - {chain.node.node_id})
    if others:
        nodes = f"node {', '.join(map(str, others))}"
        why = f"what was changed on {nodes} is not undone by this: {{}} takes all of it back"
        session.tell.note(Hint(Action.UNDO, {"all": True}, why))


def undoing(session: SessionUser, chain: RememberedDevice) -> Undoing:
    """Collect all changes of *chain*, to undo together with other nodes."""
    from dvtcli.device.change.undo_plan import unbroken
    from dvtcli.operations.changes.undo_together import Undoing

    def forget(applied: Applied, count: int) -> None:
        _forget(session, chain, applied, count)
        chain.node.unkept += 1

    return Undoing(chain.node, tuple(unbroken(_plans(chain))), False, forget, chain.findings)


def _plans(chain: RememberedDevice) -> list[Plan]:
    return [replace(entry.plan, node_id=chain.node.node_id) for entry in chain.entries]


def _forget(session: SessionUser, chain: RememberedDevice, applied: Applied, count: int) -> None:
    """Drop the newest *count* entries of *chain*, undone by *applied*."""
    undone = chain.entries[-count:]
    session.tell.note(_undone_text(undone, chain.node.node_id, gone=count > 1 and not len(applied.plan)))
    if not session.dry_run:
        chain.keeper.past.forget(undone, applied.plan)


def _chains(
    session: SessionNodes, keeping: Keeping, selected: int | None, *, only_newest: bool
) -> list[RememberedDevice]:
    """Find the chosen changes, the latest device first."""
    found: list[RememberedDevice] = []
    ids = dict.fromkeys(entry.plan.node_id for entry in keeping.past().tops(selected))
    for node_id in [*ids, *([] if selected is None or selected in ids else [selected])]:
        chain = _chain(session, node_id, selected)
        if chain is not None:
            found.append(chain)
            if only_newest:
                break
    return found


def _chain(session: SessionNodes, node_id: int, selected: int | None) -> RememberedDevice | None:
    """Find the chosen changes of the device at *node_id*; None if there is none."""
    keeper = session.open_network().node(node_id).keeper
    assert keeper is not None  # noqa: S101 - its changes are kept
    node = session.node(node_id)
    node.begin_change()
    identity = node.identity()
    entries = keeper.past.entries(node_id, identity, selected)
    if not entries and node_id == selected:
        entries = _moved(session, keeper, identity)
        if entries:
            was = entries[-1].plan.node_id
            session.tell.note(
                f"node {node_id} was node {was} when it was changed: what depends on that, as COB-IDs, may differ"
            )
    return RememberedDevice(node, keeper, entries) if entries else None


def _moved(session: SessionNodes, keeper: ChangeGuard, identity: Identity) -> list[ChangeHistoryEntry]:
    """List the device's changes under another node-ID, unless a device with this *identity* answers there."""
    entry = keeper.past.moved(keeper.node_id, identity)
    if entry is None:
        return []
    was = entry.plan.node_id
    try:
        there = session.open_network().node(was).identity()
    except (NoAnswer, SdoAborted, SdoProtocolError):
        there = {}
    # two devices may have the same serial number
    return [] if there == identity else keeper.past.entries(was, identity, None)


def _newer_elsewhere(past: ChangeHistory, chains: list[RememberedDevice]) -> tuple[Finding, ...]:
    """Warn if another node of the bus was changed later than the chosen nodes."""
    last = past.newest_of_all()
    if last is None or last.order <= max(chain.entries[-1].order for chain in chains):
        return ()
    hint = Hint(Action.UNDO, {"node": last.plan.node_id}, "undoes that")
    text = f"node {last.plan.node_id} was changed later, at {_time(last)}"
    return (warning("newer-change", f"node {last.plan.node_id}", text, hint),)


def _undone_text(undone: list[ChangeHistoryEntry], node_id: int, *, gone: bool) -> str:
    since = _time(undone[0])
    if gone:
        what = f"what was before the last {len(undone)} changes of node {node_id}, since {since},"
        return f"{what} is there already, as after a reset"
    return (
        f"this undoes the change of {since} to node {node_id}"
        if len(undone) == 1
        else (f"this undoes the {len(undone)} changes since {since} to node {node_id}")
    )


def _time(entry: ChangeHistoryEntry) -> str:
    return f"{entry.when[:19].replace('T', ' ')} UTC"


def nothing_remembered(keeping: Keeping, selected: int | None) -> UsageError | SafetyRefusal:
    """Make the error if there is nothing to undo on the *selected* node or the bus, or if that is unknown."""
    if (unread := unreadable(keeping.past().folder)) is not None:
        unread.why = "whether a change is remembered is not known: that is where changes are kept"
        return unread
    others = sorted({top.plan.node_id for top in keeping.past().tops(None)})
    if selected is None and others:
        return UsageError(
            f"nothing to undo: no change of the devices that are there as node {', '.join(map(str, others))} now is "
            "remembered",
            why="what is remembered of these node-IDs was changed on other devices (0x1018)",
            hint=Hint(Action.UNDO, {"node": "ID"}, "where these have other node-IDs now: {}"),
        )
    if selected is None:
        return UsageError("nothing to undo: no change on this bus is remembered")
    error = UsageError(f"nothing to undo: no change of node {selected} is remembered", node=selected)
    last = keeping.past().newest_of_all()
    if last is not None:
        error.hint = Hint(
            Action.UNDO,
            {"node": last.plan.node_id},
            f"the last change on this bus was one of node {last.plan.node_id}: {{}}",
        )
    return error
