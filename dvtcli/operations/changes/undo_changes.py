"""Undo changes of this session, or of earlier processes if it made none (`undo_remembered`).

`device.change.undo_plan` decides what a device must hold for an undo.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import Plan
from dvtcli.domain.script_line import change_lines
from dvtcli.errors import DvtcliError, Restarted
from dvtcli.operations.changes.change import changed
from dvtcli.operations.results import Changed, ChangedNodes

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Applied
    from dvtcli.device.node import Node
    from dvtcli.operations.changes.undo_together import Undoing
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes

T = TypeVar("T")


def undo(session: Session, *, everything: bool = False) -> Changed | ChangedNodes:
    """Undo the last change of this session, or with *everything* all of them, on every node.

    If there is none, or all are undone, changes of earlier processes are undone: of the selected node with the changes
    made together with it, or of every node on the bus if none is selected. Several nodes are undone together, phase by
    phase, all or none, unless a node is expected to refuse its old value. Raises SafetyRefusal if a device holds
    another value than the change left; an error names the nodes undone before it.
    """
    from dvtcli.operations.changes.undo_together import may_go_together, undo_together

    order = session.network.order
    if not order:
        from dvtcli.operations.changes.undo_remembered import remembered, undo_remembered_changes, undoing

        chains = remembered(session, everything=everything)
        together = [undoing(session, chain) for chain in chains]
        if everything and may_go_together(together):
            return ChangedNodes(undo_together(session, together))
        return _one_by_one(
            session, chains, lambda chain: undo_remembered_changes(session, chain, everything=everything)
        )
    if not everything:
        return _own_undone(session, order[-1], everything=False)
    node_ids = list(dict.fromkeys(reversed(order)))
    together = [_undoing(session, session.node(node_id)) for node_id in node_ids]
    if may_go_together(together):
        return ChangedNodes(undo_together(session, together))
    return _one_by_one(session, node_ids, lambda node_id: _own_undone(session, node_id, everything=True))


def undo_on(session: SessionNodes, node_id: int, *, everything: bool = False) -> Changed:
    """Undo the last change of a single node, or with *everything* all; of this session, else as `undo`."""
    if session.node(node_id).history:
        return _own_undone(session, node_id, everything=everything)
    from dvtcli.operations.changes.undo_remembered import remembered_of, undo_remembered_changes

    return undo_remembered_changes(
        session, remembered_of(session, node_id, everything=everything), everything=everything
    )


def _one_by_one(session: SessionNodes, things: Iterable[T], put_back: Callable[[T], Changed]) -> Changed | ChangedNodes:
    """Undo *things* one after another; an error names the nodes undone before it.

    Raises Restarted if a node restarted while another was undone.
    """
    done: list[Changed] = []
    again: list[int] = []
    boot_ups: dict[int, int] = {}
    try:
        for thing in things:
            done.append(one := put_back(thing))
            boot_ups[one.node] = session.bus.boot_ups(one.node)
        again += [node_id for node_id, seen in boot_ups.items() if session.bus.boot_ups(node_id) != seen]
        if again:
            raise Restarted(
                f"node {', '.join(map(str, again))} restarted after it was rolled back: what it had not stored is lost",
                hint=Hint(Action.SHOW_PDOS, why="check its supply, then what it holds with {}"),
                state="unknown",
            )
    except DvtcliError as error:
        error.beside([undone.node for undone in done if undone.node not in again], [error], "rolled back before this")
        error.nodes |= dict.fromkeys(again, "unknown")
        raise
    return done[0] if len(done) == 1 else ChangedNodes(tuple(done))


def _undoing(session: SessionNodes, node: Node) -> Undoing:
    """Collect all changes of this session on *node* for an undo."""
    from dvtcli.operations.changes.undo_together import Undoing

    def forget(applied: Applied, count: int) -> list[str] | None:
        before = node.history[:]
        node.was_undone(applied, count)
        as_before = not applied.findings
        forgotten = not session.dry_run and as_before and _forgotten(session, node.node_id, before[-count:])
        return [] if forgotten else None

    return Undoing(node, tuple(node.history), True, forget)


def _own_undone(session: SessionNodes, node_id: int, *, everything: bool) -> Changed:
    started, node = time.monotonic(), session.node(node_id)
    before = node.history[:]
    applied = node.undo(everything=everything, force=session.options.force)
    undone = before[len(node.history) :]
    as_before = not (applied.findings or applied.not_put_back)
    forgotten = not session.dry_run and as_before and _forgotten(session, node.node_id, undone)
    seconds = time.monotonic() - started
    return changed(session, node, applied, seconds, undone=True, lines=[] if forgotten else None)


def _forgotten(session: SessionNodes, node_id: int, undone: list[Plan]) -> bool:
    """Drop *undone* from what `save` writes if nothing came after it; returns whether it did.

    After a store or an NMT command the undo is saved as a change of its own.
    """
    kept = list(session.record.lines)
    for plan in reversed(undone):
        if not session.record.take_back(node_id, change_lines(plan)):
            session.record.lines[:] = kept
            return False
    return True
