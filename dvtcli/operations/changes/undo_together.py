"""Undo changes of several nodes together, phase by phase, all or nothing.

The caller knows how to drop undone changes from its history.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.change.applied import Applied
from dvtcli.device.change.apply_plan import enter
from dvtcli.device.change.expected_refusals import foreseen
from dvtcli.device.change.journal import combine_plans
from dvtcli.device.change.own_journal import complete_groups
from dvtcli.device.change.undo_plan import UndoPlan, UndoRequest, plan_undo, refuse_unknown
from dvtcli.device.change.untouched_pdos import as_they_are, untouched_pdos
from dvtcli.domain.plan import STAMP, Change, PdoChange, Plan, ValueChange, plan_pdo
from dvtcli.operations.changes.change import AlsoExpected, NoOtherExpectations, change_result, require_held
from dvtcli.operations.changes.network_phases import apply_together

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session


@dataclass(frozen=True, slots=True)
class NodeUndo:
    """The changes of *node* to undo: *plans*, oldest first; *own* are those of this session.

    *forget* is called after the undo with its result and the number of undone changes; it returns lines for `save`,
    None for those of the plan. *findings* are reported along.
    """

    node: Node
    plans: Sequence[Plan]
    own: bool
    forget: Callable[[Applied, int], list[str] | None]
    findings: tuple[Finding, ...] = ()


def may_go_together(undoings: Sequence[NodeUndo]) -> bool:
    """Tell whether the undos are on several devices, none of which is expected to refuse its old values."""
    return len(undoings) > 1 and not any(foreseen(undoing.plans) for undoing in undoings)


def undo_together(session: Session, undoings: Sequence[NodeUndo]) -> tuple[Changed, ...]:
    """Undo every change of *undoings*, or none; raises any error of a node with state `rolled_back`.

    A side effect on other PDOs is a fault, too. Raises SafetyRefusal if a device holds another value than the change
    left; LeftChanged if a node could not be returned to its state before the undo.
    """
    started = time.monotonic()
    nodes = {node_undoing.node.node_id: node_undoing.node for node_undoing in undoings}
    with session.cancellation.guard():
        found = {node_id: node.begin_change() for node_id, node in sorted(nodes.items())}
        force = session.options.force
        backs = {
            node_undoing.node.node_id: plan_undo(
                node_undoing.node,
                UndoRequest(
                    node_undoing.plans, everything=True, force=force, own=node_undoing.own, is_part_of_group=True
                ),
            )
            for node_undoing in undoings
        }
        if not force and not any(back.plan.changes for back in backs.values()):
            for back in backs.values():
                refuse_unknown(back)
        for node_id, back in backs.items():
            if len(back.plan):
                enter(nodes[node_id], found[node_id])  # whoever is asked is asked before the first write
        plans = {node_id: back.plan for node_id, back in backs.items()}
        findings = {node_id: back.unknown for node_id, back in backs.items()}
        held = {node_id: _as_before(back) for node_id, back in backs.items()}
        written = [node_id for node_id, back in backs.items() if len(back.plan)]
        for fault in session.bus.side_by_side([partial(_read_pdos, nodes[node_id]) for node_id in written]):
            raise fault
        for node_id in written:
            held[node_id] += _untouched(nodes[node_id], Plan(node_id, (*plans[node_id].changes, *held[node_id])))

        equal = {node_id: held[node_id] for node_id, back in backs.items() if not len(back.plan)}
        also = AlsoExpected(held, others=_EqualNodes(nodes, equal))
        with apply_together(session, nodes, plans, found, "undo of all", findings, also) as transaction:
            complete_groups(transaction.journals())
    done = []
    for undoing in undoings:
        node, back = undoing.node, backs[undoing.node.node_id]
        applied = Applied(back.plan, (*back.unknown, *undoing.findings), unrestored=back.unrestored)
        lines = undoing.forget(applied, len(back.undone))
        done.append(change_result(session, node, applied, time.monotonic() - started, undone=True, lines=lines))
    return tuple(done)


@dataclass(frozen=True, slots=True)
class _EqualNodes(NoOtherExpectations):
    """Nodes that already hold their old values: nothing is written, and *held* is claimed."""

    nodes: Mapping[int, Node]
    held: Mapping[int, Sequence[Change]]

    def verify(self) -> None:
        for node_id, changes in self.held.items():
            require_held(self.nodes[node_id], changes)


def _as_before(back: UndoPlan) -> tuple[Change, ...]:
    """List values that are as before the changes of *back* and need no write, each as a change."""
    written = {change.label for change in back.plan.changes if change.steps}
    changes = combine_plans(back.plan.node_id, back.undone).changes if back.undone else ()
    return tuple(_to_the_same(change) for change in changes if change.label not in written and _is_undone(change))


def _read_pdos(node: ReadableNode) -> None:
    node.known_pdos()


def _untouched(node: ReadableNode, plan: Plan) -> tuple[Change, ...]:
    """List the PDOs of *node* outside *plan*: the undo may have side effects on them."""
    present = untouched_pdos(node, plan)
    return as_they_are({pdo: config for pdo, config in node.last_read.items() if pdo in present})


def _is_undone(change: Change) -> bool:
    """Tell whether the old value is known and returns with the undo; a stamp does not."""
    return isinstance(change, PdoChange) or (change.is_readable and change.step.index != STAMP)


def _to_the_same(change: Change) -> Change:
    if isinstance(change, PdoChange):
        return plan_pdo(change.pdo, change.before, change.before)
    return ValueChange(change.step.otherwise(change.step.before, change.step.before or b"", change.step.reason))
