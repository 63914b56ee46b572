"""Putting changes back: of this session, or where it made none, of earlier processes (`undo_remembered`).

Parses no words. What a device must hold so that a change may be put back is decided in `device.change.way_back`.
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
    from dvtcli.device.applied import Applied
    from dvtcli.device.node import Node
    from dvtcli.operations.changes.undo_together import Undoing
    from dvtcli.operations.session.session import Session

T = TypeVar("T")


def undo(session: Session, *, everything: bool = False) -> Changed | ChangedNodes:
    """Put back the last change of this session, or with *everything* all of them, on every node.

    Where it changed nothing, or has undone it all, those of earlier processes: of the selected node and what was
    changed from there, or of every node of the bus where none is selected. Several nodes go back together, phase by
    phase, all or none, unless one of them is expected to refuse what it held. SafetyRefusal where a device holds
    something else than what was left; an error says which nodes were put back before it.
    """
    from dvtcli.operations.changes.undo_together import may_go_together, undo_together

    order = session.network.order
    if not order:
        from dvtcli.operations.changes.undo_remembered import put_remembered_back, remembered, undoing

        chains = remembered(session, everything=everything)
        together = [undoing(session, chain) for chain in chains]
        if everything and may_go_together(together):
            return ChangedNodes(undo_together(session, together))
        return _one_by_one(session, chains, lambda chain: put_remembered_back(session, chain, everything=everything))
    if not everything:
        return _own_put_back(session, order[-1], everything=False)
    node_ids = list(dict.fromkeys(reversed(order)))
    together = [_undoing(session, session.node(node_id)) for node_id in node_ids]
    if may_go_together(together):
        return ChangedNodes(undo_together(session, together))
    return _one_by_one(session, node_ids, lambda node_id: _own_put_back(session, node_id, everything=True))


def undo_on(session: Session, node_id: int, *, everything: bool = False) -> Changed:
    """Put back the last change of one node alone, or with *everything* all of them: of this session, else as above."""
    if session.node(node_id).history:
        return _own_put_back(session, node_id, everything=everything)
    from dvtcli.operations.changes.undo_remembered import put_remembered_back, remembered_of

    return put_remembered_back(session, remembered_of(session, node_id, everything=everything), everything=everything)


def _one_by_one(session: Session, things: Iterable[T], put_back: Callable[[T], Changed]) -> Changed | ChangedNodes:
    """Put one after the other back; an error says which nodes were before it.

    Restarted where one of them restarted while another was put back.
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
                f"node {', '.join(map(str, again))} restarted after it was put back: what it had not stored is lost",
                hint=Hint(Action.SHOW_PDOS, why="look at its supply, then at what it holds with {}"),
                state="unknown",
            )
    except DvtcliError as error:
        ids = [str(undone.node) for undone in done if undone.node not in again]
        if ids:
            error.details.append(("done", f"node {', '.join(ids)}: put back before this"))
        raise
    return done[0] if len(done) == 1 else ChangedNodes(tuple(done))


def _undoing(session: Session, node: Node) -> Undoing:
    """All that this session changed on *node*, to be put back."""
    from dvtcli.operations.changes.undo_together import Undoing

    def forget(applied: Applied, count: int) -> list[str] | None:
        before = node.history[:]
        node.was_undone(applied, count)
        as_before = not applied.findings
        forgotten = not session.dry_run and as_before and _forgotten(session, node.node_id, before[-count:])
        return [] if forgotten else None

    return Undoing(node, tuple(node.history), True, forget)


def _own_put_back(session: Session, node_id: int, *, everything: bool) -> Changed:
    started, node = time.monotonic(), session.node(node_id)
    before = node.history[:]
    applied = node.undo(everything=everything, force=session.options.force)
    undone = before[len(node.history) :]
    as_before = not (applied.findings or applied.not_put_back)
    forgotten = not session.dry_run and as_before and _forgotten(session, node.node_id, undone)
    seconds = time.monotonic() - started
    return changed(session, node, applied, seconds, undone=True, lines=[] if forgotten else None)


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
