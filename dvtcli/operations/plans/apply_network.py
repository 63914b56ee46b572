"""Carry out the plan for a network: all nodes are changed, or all are rolled back.

Takes plans as `plan_network` judged them.
"""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.change.change_group import Storing
from dvtcli.device.change.own_journal import complete_groups
from dvtcli.device.seen_state import present_state
from dvtcli.domain.network.links import MOVES
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.script_line import change_lines
from dvtcli.domain.text import plural
from dvtcli.operations.changes.change import keep_words
from dvtcli.operations.changes.final_verify import AlsoExpected, ExpectedAtStore
from dvtcli.operations.changes.network_phases import apply_together
from dvtcli.operations.changes.possible_stores import refuse_unprovable_stores
from dvtcli.operations.changes.store_network import store_network
from dvtcli.operations.pdos.sync import short_frames
from dvtcli.operations.plans.plan_network import with_unknown_syncs
from dvtcli.operations.plans.unwritten_values import UnwrittenValues, refuse_stale, steady
from dvtcli.operations.results.networks import NetworkApplied
from dvtcli.operations.session.consent import refuse_other_master, refuse_powered

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
    from dvtcli.domain.plan import Plan
    from dvtcli.operations.changes.network_transaction import NetworkTransaction
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes


def apply_network(
    session: Session, plan: NetworkPlan, *, prove: str | None = None, name: str = "", asks: bool = True
) -> NetworkApplied:
    """Carry out *plan* on all its nodes, in phases; a fault on one node rolls back all of them.

    *name* is the name of the change (default: `apply FILE`). Asks first; without *asks* only if a node is OPERATIONAL.
    After all nodes were verified, those whose file says `store` store; with *prove* (`reset`, `power`) each of them is
    restarted and compared. Raises SafetyRefusal if a node differs from what it was planned from or another master is
    active; any error of a node with state `rolled_back`; LeftChanged if a roll-back or a store failed.
    """
    planned = [node for node in plan.nodes if len(node.plan) or node.stores]
    nodes = {node.node_id: session.node(node.node_id) for node in plan.nodes}
    powered_off = [node_plan.node_id for node_plan in planned if node_plan.needs_power_off]
    refuse_powered(session, powered_off)
    if prove and not session.dry_run:
        refuse_unprovable_stores(
            nodes, {node_plan.node_id: node_plan.store for node_plan in planned if node_plan.stores}, prove
        )
    asked = False
    if planned:
        if asks or any(nodes[node_plan.node_id].access.state() is NmtState.OPERATIONAL for node_plan in planned):
            session.consent(_question(nodes, planned, f"{name}:" if name else "apply", prove))
            asked = True
        plan = _listened(session, plan)
    started = time.monotonic()  # nobody's time to think counts
    with session.cancellation.guard(), session.agreed():
        found = {node_id: node.begin_change() for node_id, node in sorted(nodes.items())}
        claims = UnwrittenValues(session, nodes, plan.nodes)
        claims.require_as_planned()  # while it was planned, or while somebody took time to answer
        if not planned:  # what is as wanted may be what an interrupted change left
            return NetworkApplied(plan, session.dry_run, 0.0)
        _refuse_any_stale(session, nodes, planned, kept=asked and not session.options.yes)
        refuse_powered(session, powered_off)  # somebody took time to answer
        plans = {node_plan.node_id: node_plan.plan for node_plan in planned}
        stores, equal = _stores(planned), _equal(nodes, plan.nodes)
        also = AlsoExpected(claims.held(), stores, equal, prove is not None, claims)
        findings = {node_plan.node_id: node_plan.findings for node_plan in planned}
        with claims.rolled_back_group():
            transaction = apply_together(session, nodes, plans, found, name or f"apply {plan.file}", findings, also)
        with transaction:
            _keep(session, nodes, transaction.plans)
            at_store = _claims_at_store(session, transaction, claims, found)
            stored = store_network(session, transaction, stores, at_store, prove, equal)
            complete_groups(transaction.journals())
    kept = {
        node_plan.node_id: keep_words(nodes[node_plan.node_id], node_plan.plan)
        for node_plan in planned
        if len(node_plan.plan)
    }
    without = {
        node_plan.node_id: _kept_without(nodes[node_plan.node_id], node_plan.plan)
        for node_plan in planned
        if kept.get(node_plan.node_id)
    }
    not_remembered = tuple(
        node_id for node_id, node in nodes.items() if node.guard is not None and not node.guard.history.remembers_last
    )
    seconds = time.monotonic() - started
    return NetworkApplied(plan, session.dry_run, seconds, stored, kept, without, not_remembered=not_remembered)


def _kept_without(node: NodeDescription, plan: Plan) -> tuple[str, ...]:
    """List the labels of *plan* that *node* keeps without a store."""
    policy = node.profile.store
    return tuple(
        change.label
        for change in plan.changes
        if change.steps and not any(policy.needed_for(step.index) for step in change.steps)
    )


def _listened(session: SessionNodes, plan: NetworkPlan) -> NetworkPlan:
    """Add the received SYNCs to *plan*; raises SafetyRefusal if another master is active."""
    with short_frames(session.bus) as frames:
        refuse_other_master(session)
    return with_unknown_syncs(session, plan, frames)


def _refuse_any_stale(
    session: SessionNodes, nodes: Mapping[int, ReadableNode], planned: list[NodePlan], *, kept: bool
) -> None:
    """Apply `refuse_stale` to all nodes; with *kept* also if values that are to stay have changed.

    Somebody may have changed them while the question was open: a roll-back would treat that as a side effect.
    """

    def refuse(one: NodePlan) -> None:
        node = nodes[one.node_id]
        refuse_stale(node, one, (*one.plan.changes, *(steady(node, one.holds) if kept else ())))

    for fault in session.bus.side_by_side([partial(refuse, plan) for plan in planned]):
        raise fault


def _keep(session: SessionNodes, nodes: Mapping[int, Node], done: Mapping[int, Plan]) -> None:
    """Make *done* undoable and add it to the session's record."""
    for node_id, plan in done.items():
        nodes[node_id].keep(plan)
        if not session.dry_run:
            session.record.add(node_id, change_lines(plan))


def _claims_at_store(
    session: Session,
    transaction: NetworkTransaction,
    claims: UnwrittenValues,
    initial_states: Mapping[int, InitialState],
) -> ExpectedAtStore:
    """Read what each node that is written or stores holds: changed values and other values of the file."""
    planned = [plan for plan in claims.planned if len(plan.plan) or plan.stores]
    held = {plan.node_id: plan.holds for plan in planned if not len(plan.plan)}
    boot_ups = {plan.node_id: initial_states[plan.node_id].boot_ups for plan in planned if not plan.stores}
    identities = {plan.node_id: plan.identity for plan in planned}
    return ExpectedAtStore(session, transaction.nodes, {**held, **transaction.claims()}, identities, boot_ups, claims)


def _stores(planned: Sequence[NodePlan]) -> tuple[Storing, ...]:
    """List the stores of *planned*; an unchanged node comes with its values, as no journal has them."""
    return tuple(
        Storing(plan.node_id, plan.store, identity=plan.identity, holds=() if len(plan.plan) else plan.holds)
        for plan in planned
        if plan.stores
    )


def _equal(nodes: Mapping[int, ReadableNode], planned: Sequence[NodePlan]) -> tuple[Storing, ...]:
    """List the nodes that equal *planned* and neither change nor store, each with its values."""
    return tuple(
        Storing(plan.node_id, "", identity=plan.identity, holds=tuple(steady(nodes[plan.node_id], plan.holds)))
        for plan in planned
        if not (plan.stores or len(plan.plan)) and plan.is_read
    )


def _question(nodes: Mapping[int, Node], planned: list[NodePlan], name: str, prove: str | None) -> str:
    writes = plural(sum(len(plan.plan) for plan in planned), "write")
    stores = [str(plan.node_id) for plan in planned if plan.stores]
    store = f", and store on node {', '.join(stores)}" if stores else ""
    if stores and prove == "reset":
        store += f", then reset {'it' if len(stores) == 1 else 'them'}"
    doubts = "".join(f"{plan.doubt}; " for plan in planned if plan.doubt)
    moved = [said.text for plan in planned for said in plan.findings if said.rule in MOVES]
    doubts += "".join(f"{text}; " for text in moved)
    text = f"{doubts}{name} {writes} to node {', '.join(str(plan.node_id) for plan in planned)}{store}?"
    leaving = (nodes[plan.node_id] for plan in planned if nodes[plan.node_id].is_pre_operational_wanted)
    running = [str(node.node_id) for node in leaving if present_state(node.access) is NmtState.OPERATIONAL]
    if running:
        text = f"node {', '.join(running)} is set from OPERATIONAL to PRE-OPERATIONAL and back; {text}"
    return text
