"""Carry out the plan for a network, and verify values held before: all nodes change, or all are rolled back.

Takes plans as `plan_network` judged them.
"""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.change.change_group import Storing
from dvtcli.device.change.changeable import moves
from dvtcli.device.change.own_journal import complete_groups
from dvtcli.device.change.roll_back import first_difference
from dvtcli.device.change.untouched_pdos import changes_a_pdo
from dvtcli.device.observe import MAX_READS
from dvtcli.device.read_whole import PAUSE_S
from dvtcli.device.seen_state import present_state
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.links import MOVES
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, ValueChange, plan_pdo
from dvtcli.domain.script_line import change_lines
from dvtcli.domain.text import all_nodes, join_some, plural
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, Restarted, SafetyRefusal
from dvtcli.operations.changes.change import store_hint
from dvtcli.operations.changes.network_phases import BesidesPlans, ClaimsAtStore, apply_together, require_held
from dvtcli.operations.changes.possible_stores import refuse_unprovable_stores
from dvtcli.operations.changes.store_network import store_network
from dvtcli.operations.pdos.sync import short_frames
from dvtcli.operations.plans.plan_network import with_unknown_syncs
from dvtcli.operations.results.networks import NetworkApplied
from dvtcli.operations.session.consent import refuse_other_master, refuse_powered

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
    from dvtcli.domain.plan import Plan
    from dvtcli.operations.changes.network_transaction import NetworkTransaction
    from dvtcli.operations.session.session import Session, SessionNodes


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
    with session.cancellation.deferred(), session.agreed():
        found = {node_id: node.begin_change() for node_id, node in sorted(nodes.items())}
        unwritten = UnwrittenClaims(session, nodes, plan.nodes)
        unwritten.require_as_planned()  # while it was planned, or while somebody took time to answer
        if not planned:  # what is as wanted may be what an interrupted change left
            return NetworkApplied(plan, session.dry_run, 0.0)
        _refuse_any_stale(session, nodes, planned, kept=asked and not session.options.yes)
        refuse_powered(session, powered_off)  # somebody took time to answer
        plans = {node_plan.node_id: node_plan.plan for node_plan in planned}
        stores, equal = _stores(planned), _equal(nodes, plan.nodes)
        besides = BesidesPlans(unwritten.held(), stores, equal, prove is not None, unwritten)
        findings = {node_plan.node_id: node_plan.findings for node_plan in planned}
        with unwritten.rolled_back_group():
            transaction = apply_together(session, nodes, plans, found, name or f"apply {plan.file}", findings, besides)
        with transaction:
            _keep(session, nodes, transaction.plans)
            at_store = _claims_at_store(session, transaction, unwritten, found)
            stored = store_network(session, transaction, stores, at_store, prove, equal)
            complete_groups(transaction.journals())
    kept = {
        node_plan.node_id: store_hint(nodes[node_plan.node_id], node_plan.plan)
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
        nodes[node_id].remember_for_undo(plan)
        if not session.dry_run:
            session.record.add(node_id, change_lines(plan))


def _claims_at_store(
    session: Session,
    transaction: NetworkTransaction,
    unwritten: UnwrittenClaims,
    initial_states: Mapping[int, InitialState],
) -> ClaimsAtStore:
    """Read what each node that is written or stores holds: changed values and other values of the file."""
    planned = [plan for plan in unwritten.planned if len(plan.plan) or plan.stores]
    held = {plan.node_id: plan.holds for plan in planned if not len(plan.plan)}
    boot_ups = {plan.node_id: initial_states[plan.node_id].boot_ups for plan in planned if not plan.stores}
    identities = {plan.node_id: plan.identity for plan in planned}
    return ClaimsAtStore(
        session, transaction.nodes, {**held, **transaction.claims_by_node()}, identities, boot_ups, unwritten
    )


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
    store = f", and store on {all_nodes(stores)}" if stores else ""
    if stores and prove == "reset":
        store += f", then reset {'it' if len(stores) == 1 else 'them'}"
    doubts = "".join(f"{plan.doubt}; " for plan in planned if plan.doubt)
    moved = [said.text for plan in planned for said in plan.findings if said.rule in MOVES]
    doubts += "".join(f"{text}; " for text in moved)
    text = f"{doubts}{name} {writes} to {all_nodes([plan.node_id for plan in planned])}{store}?"
    leaving = (nodes[plan.node_id] for plan in planned if nodes[plan.node_id].is_pre_operational_wanted)
    running = [str(node.node_id) for node in leaving if present_state(node.access) is NmtState.OPERATIONAL]
    if running:
        text = f"{all_nodes(running)}: from OPERATIONAL to PRE-OPERATIONAL and back; {text}"
    return text


@dataclass(slots=True)
class UnwrittenClaims:
    """The values that *planned* claims for *nodes* without writing them; all were read before."""

    session: Session
    nodes: Mapping[int, Node]
    planned: Sequence[NodePlan]
    _seen: dict[int, int] = field(default_factory=dict)

    def held(self) -> dict[int, tuple[Change, ...]]:
        """Read the file's values on each written node, and before a store all its PDOs.

        Each value is a change to itself. Raises the errors of reading PDOs for nodes that store.
        """
        written = [plan for plan in self.planned if len(plan.plan)]
        stores = [plan.node_id for plan in written if plan.stores and changes_a_pdo(plan.plan)]
        self._side_by_side([partial(_read_pdos, self.nodes[node_id]) for node_id in stores])
        return {plan.node_id: _held(self.nodes[plan.node_id], plan, beside=plan.node_id in stores) for plan in written}

    def verify(self) -> None:
        """Verify nodes without writes, and the unwritten settings of the file on the others.

        Raises Restarted if a node restarted and lost what was planned from, DeviceRefused if a value differs.
        """
        equal = self._equal()
        reads = [partial(_refuse_unequal, self.nodes[plan.node_id], plan) for plan in equal if plan.is_read]
        reads += [
            partial(_refuse_altered, self.nodes[plan.node_id], plan) for plan in self.planned if plan.compared_values
        ]
        for _ in range(MAX_READS):
            self.verify_restarted()
            self._side_by_side(reads)
            restarted = [plan.node_id for plan in equal if self._has_restarted(plan)]
            if not restarted:  # what was read of the first ones may be lost by now
                return
        raise _restarts(restarted[0])

    def verify_restarted(self) -> None:
        """Raises Restarted if a node without writes restarted and lost what was planned from."""
        try:
            self.require_as_planned({plan.node_id for plan in self._equal()})
        except SafetyRefusal as lost:
            hint = "check its supply, then try again"
            raise Restarted(lost.text, node=lost.node, place=lost.place, why=lost.why, hint=hint) from lost

    def _equal(self) -> list[NodePlan]:
        """List the plans of nodes without writes, including nodes that store: they are read before the first store."""
        return [plan for plan in self.planned if not len(plan.plan)]

    def require_as_planned(self, of: Collection[int] | None = None) -> None:
        """Raises SafetyRefusal if a node of *of* (None: all) restarted and differs from what it was planned from."""
        for _ in range(MAX_READS):
            restarted = [
                node_plan
                for node_plan in self.planned
                if of is None or node_plan.node_id in of
                if self._has_restarted(node_plan)
            ]
            for plan in restarted:
                node = self.nodes[plan.node_id]
                self._seen[plan.node_id] = node.bus.boot_ups(plan.node_id)
                node.read_anew()
                node.observed(partial(_refuse_unlike, node, plan))
            if not restarted:
                return
        raise _restarts(restarted[0].node_id)

    @contextmanager
    def rolled_back_group(self) -> Iterator[None]:
        """LeftChanged if a device holds another value of a setting without a write after a roll-back."""
        try:
            yield
        except DvtcliError as fault:
            if fault.state == "rolled_back":
                self._refuse_left_altered(fault)
            raise

    def _refuse_left_altered(self, fault: DvtcliError) -> None:
        for planned in (plan for plan in self.planned if plan.compared_values):
            node = self.nodes[planned.node_id]
            try:
                altered = node.observed(partial(_altered, node, planned))
            except DvtcliError as unseen:
                what = f"whether node {node.node_id} altered other settings is not known"
                fault.details.append(("also", f"{what}: {unseen.text}"))
                continue
            if altered:
                left = LeftChanged(
                    fault.text,
                    node=node.node_id,
                    why=join_some(altered.values()),
                    state="left_changed",
                    hint=Hint(
                        Action.WRITE,
                        why=f"sets {join_some(altered)} again, if needed: the plan of a file does not",
                    ),
                )
                left.state_text = (
                    f"node {node.node_id} has changed {join_some(altered)}; the planned values are rolled back and "
                    f"verified; nothing was stored"
                )
                raise left from fault

    def _side_by_side(self, reads: Sequence[partial[None]]) -> None:
        for fault in self.session.bus.side_by_side(reads) if reads else ():
            raise fault

    def _has_restarted(self, planned: NodePlan) -> bool:
        now = self.nodes[planned.node_id].bus.boot_ups(planned.node_id)
        first = now if planned.boot_ups is None else planned.boot_ups
        return self._seen.setdefault(planned.node_id, first) != now


def _restarts(node_id: int) -> Restarted:
    return Restarted(f"node {node_id} restarted during each of {MAX_READS} reads", node=node_id)


def _refuse_unequal(node: ReadableNode, planned: NodePlan) -> None:
    """Raises DeviceRefused if *node*, which gets no write, no longer holds the file's values."""
    require_held(node, steady(node, planned.holds))


def _read_pdos(node: ReadableNode) -> None:
    node.known_pdos()


def _held(node: ReadableNode, planned: NodePlan, *, beside: bool) -> tuple[Change, ...]:
    """List what *node* holds and *planned* does not write; with *beside* also PDOs outside the file."""
    own = {change.pdo for change in planned.plan.changes if isinstance(change, PdoChange)}
    said = [change for change in steady(node, planned.holds) if _pdo_of(change) not in own]
    told = {change.pdo for change in said if isinstance(change, PdoChange)}
    others = [
        plan_pdo(pdo, config, config)
        for pdo, config in (node.last_read.items() if beside else ())
        if pdo not in own | told and config.has_cob_id and not config.untold
    ]
    return (*said, *others)


def _pdo_of(change: Change) -> Pdo | None:
    """Return the PDO if *change* writes a single object of a PDO."""
    return Pdo.at(change.step.index) if isinstance(change, ValueChange) else None


def steady(node: ReadableNode, changes: Sequence[Change]) -> list[Change]:
    """Leave out *changes* of objects that the machine changes all the time."""
    return [change for change in changes if _is_steady(node, change)]


def _is_steady(node: ReadableNode, change: Change) -> bool:
    """Tell whether the object of *change* stays constant while the machine runs."""
    return not (isinstance(change, ValueChange) and moves(node, change.step.index, change.step.sub_index))


def _refuse_altered(node: ReadableNode, planned: NodePlan) -> None:
    """Raises DeviceRefused if *node* altered settings of the file that were equal and got no write."""
    altered = node.observed(partial(_altered, node, planned))
    if altered:
        raise DeviceRefused(
            f"node {node.node_id} changed {join_some(altered)} as a side effect of the written values",
            node=node.node_id,
            why=join_some(altered.values()),
            hint="these settings depend on each other in this device: see its manual",
        )


def _altered(node: ReadableNode, planned: NodePlan) -> dict[str, str]:
    """Map altered settings to their difference, except those that change by themselves."""
    differing = {
        change: found
        for change in planned.compared_claims
        if _is_steady(node, change) and (found := first_difference(node.sdo, change))
    }
    if differing:
        node.bus.sleep(PAUSE_S)
    return {change.label: found for change, found in differing.items() if first_difference(node.sdo, change) == found}


def refuse_stale(node: ReadableNode, planned: NodePlan, changes: Collection[Change], what: str = "has changed") -> None:
    """Raises SafetyRefusal if *node* is another device than planned or *changes* would replace new values.

    *what* completes the message: what happened to the value.
    """
    if node.identity() != planned.identity:
        raise _stale(node, "is another device than the plan is for")
    look = node.read_cache.look()
    for change in changes:
        difference = first_difference(look, change, wanted_before=True)  # empty when the claim was made
        if difference:
            raise _stale(node, f"{what} since the plan was made: {change.label}", change.label, difference)


def _refuse_unlike(node: ReadableNode, planned: NodePlan) -> None:
    """Raises SafetyRefusal if *node* restarted and differs from *planned*, or was not checked since."""
    if not planned.is_read:
        raise _stale(node, "restarted after its stamp was used instead of a read")
    refuse_stale(node, planned, (*planned.plan.changes, *planned.holds), "restarted, and has changed")


def _stale(node: NodeDescription, what: str, place: str | None = None, why: str | None = None) -> SafetyRefusal:
    hint = Hint(Action.PLAN, {"node": None}, "again, and check the changed values")
    return SafetyRefusal(f"node {node.node_id} {what}", node=node.node_id, place=place, why=why, hint=hint)
