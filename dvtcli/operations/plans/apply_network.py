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
    from dvtcli.domain.store import ProveBy
    from dvtcli.operations.changes.network_transaction import NetworkTransaction
    from dvtcli.operations.session.session import Session, SessionNodes


def apply_network(
    session: Session, network_plan: NetworkPlan, *, prove: ProveBy | None = None, name: str = "", asks: bool = True
) -> NetworkApplied:
    """Carry out *network_plan* on all its nodes, in phases; a fault on one node rolls back all of them.

    *name* is the name of the change (default: `apply FILE`). Asks first; without *asks* only if a node is OPERATIONAL.
    After all nodes were verified, those whose file says `store` store; with *prove* (`reset`, `power`) each of them is
    restarted and compared. Raises SafetyRefusal if a node differs from what it was planned from or another master is
    active; any error of a node with state `rolled_back`; LeftChanged if a roll-back or a store failed.
    """
    to_do = [node_plan for node_plan in network_plan.nodes if len(node_plan.plan) or node_plan.stores]
    nodes = {node_plan.node_id: session.node(node_plan.node_id) for node_plan in network_plan.nodes}
    powered_off = [node_plan.node_id for node_plan in to_do if node_plan.needs_power_off]
    refuse_powered(session, powered_off)
    if prove and not session.dry_run:
        refuse_unprovable_stores(
            nodes, {node_plan.node_id: node_plan.store for node_plan in to_do if node_plan.stores}, prove
        )
    asked = False
    if to_do:
        if asks or any(nodes[node_plan.node_id].access.state() is NmtState.OPERATIONAL for node_plan in to_do):
            session.consent(_question(nodes, to_do, f"{name}:" if name else "apply", prove))
            asked = True
        network_plan = _listened(session, network_plan)
    started = time.monotonic()  # nobody's time to think counts
    with session.cancellation.deferred(), session.agreed():
        initial_states = {node_id: node.begin_change() for node_id, node in sorted(nodes.items())}
        unwritten = UnwrittenClaims(session, nodes, network_plan.nodes)
        unwritten.require_as_planned()  # while it was planned, or while somebody took time to answer
        if not to_do:  # what is as wanted may be what an interrupted change left
            return NetworkApplied(network_plan, session.dry_run, 0.0)
        _refuse_any_stale(session, nodes, to_do, kept=asked and not session.options.yes)
        refuse_powered(session, powered_off)  # somebody took time to answer
        plans = {node_plan.node_id: node_plan.plan for node_plan in to_do}
        stores, equal = _stores(to_do), _equal(nodes, network_plan.nodes)
        besides = BesidesPlans(unwritten.held(), stores, equal, prove is not None, unwritten)
        findings = {node_plan.node_id: node_plan.findings for node_plan in to_do}
        with unwritten.rolled_back_group():
            transaction = apply_together(
                session, nodes, plans, initial_states, name or f"apply {network_plan.file}", findings, besides
            )
        with transaction:
            _keep(session, nodes, transaction.plans)
            at_store = _claims_at_store(session, transaction, unwritten, initial_states)
            stored = store_network(session, transaction, stores, at_store, prove, equal)
            complete_groups(transaction.journals())
    kept = {
        node_plan.node_id: store_hint(nodes[node_plan.node_id], node_plan.plan)
        for node_plan in to_do
        if len(node_plan.plan)
    }
    without = {
        node_plan.node_id: _kept_without(nodes[node_plan.node_id], node_plan.plan)
        for node_plan in to_do
        if kept.get(node_plan.node_id)
    }
    not_remembered = tuple(
        node_id for node_id, node in nodes.items() if node.guard is not None and not node.guard.history.remembers_last
    )
    seconds = time.monotonic() - started
    return NetworkApplied(network_plan, session.dry_run, seconds, stored, kept, without, not_remembered=not_remembered)


def _kept_without(node: NodeDescription, plan: Plan) -> tuple[str, ...]:
    """List the labels of *plan* that *node* keeps without a store."""
    policy = node.profile.store
    return tuple(
        change.label
        for change in plan.changes
        if change.steps and not any(policy.needed_for(step.index) for step in change.steps)
    )


def _listened(session: SessionNodes, network_plan: NetworkPlan) -> NetworkPlan:
    """Add the received SYNCs to *network_plan*; raises SafetyRefusal if another master is active."""
    with short_frames(session.bus) as frames:
        refuse_other_master(session)
    return with_unknown_syncs(session, network_plan, frames)


def _refuse_any_stale(
    session: SessionNodes, nodes: Mapping[int, ReadableNode], to_do: list[NodePlan], *, kept: bool
) -> None:
    """Apply `refuse_stale` to all nodes; with *kept* also if values that are to stay have changed.

    Somebody may have changed them while the question was open: a roll-back would treat that as a side effect.
    """

    def refuse(node_plan: NodePlan) -> None:
        node = nodes[node_plan.node_id]
        refuse_stale(node, node_plan, (*node_plan.plan.changes, *(steady(node, node_plan.holds) if kept else ())))

    for fault in session.bus.side_by_side([partial(refuse, node_plan) for node_plan in to_do]):
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
    node_plans = [node_plan for node_plan in unwritten.node_plans if len(node_plan.plan) or node_plan.stores]
    held = {node_plan.node_id: node_plan.holds for node_plan in node_plans if not len(node_plan.plan)}
    boot_ups = {
        node_plan.node_id: initial_states[node_plan.node_id].boot_ups
        for node_plan in node_plans
        if not node_plan.stores
    }
    identities = {node_plan.node_id: node_plan.identity for node_plan in node_plans}
    return ClaimsAtStore(
        session, transaction.nodes, {**held, **transaction.claims_by_node()}, identities, boot_ups, unwritten
    )


def _stores(node_plans: Sequence[NodePlan]) -> tuple[Storing, ...]:
    """List the stores of *node_plans*; an unchanged node comes with its values, as no journal has them."""
    return tuple(
        Storing(
            node_plan.node_id,
            node_plan.store,
            identity=node_plan.identity,
            holds=() if len(node_plan.plan) else node_plan.holds,
        )
        for node_plan in node_plans
        if node_plan.stores
    )


def _equal(nodes: Mapping[int, ReadableNode], node_plans: Sequence[NodePlan]) -> tuple[Storing, ...]:
    """List the nodes that equal *node_plans* and neither change nor store, each with its values."""
    return tuple(
        Storing(
            node_plan.node_id,
            "",
            identity=node_plan.identity,
            holds=tuple(steady(nodes[node_plan.node_id], node_plan.holds)),
        )
        for node_plan in node_plans
        if not (node_plan.stores or len(node_plan.plan)) and node_plan.is_read
    )


def _question(nodes: Mapping[int, Node], node_plans: list[NodePlan], name: str, prove: ProveBy | None) -> str:
    writes = plural(sum(len(node_plan.plan) for node_plan in node_plans), "write")
    stores = [str(node_plan.node_id) for node_plan in node_plans if node_plan.stores]
    store = f", and store on {all_nodes(stores)}" if stores else ""
    if stores and prove == "reset":
        store += f", then reset {'it' if len(stores) == 1 else 'them'}"
    doubts = "".join(f"{node_plan.doubt}; " for node_plan in node_plans if node_plan.doubt)
    moved = [said.text for node_plan in node_plans for said in node_plan.findings if said.rule in MOVES]
    doubts += "".join(f"{text}; " for text in moved)
    text = f"{doubts}{name} {writes} to {all_nodes([node_plan.node_id for node_plan in node_plans])}{store}?"
    leaving = (
        nodes[node_plan.node_id] for node_plan in node_plans if nodes[node_plan.node_id].is_pre_operational_wanted
    )
    running = [str(node.node_id) for node in leaving if present_state(node.access) is NmtState.OPERATIONAL]
    if running:
        text = f"{all_nodes(running)}: from OPERATIONAL to PRE-OPERATIONAL and back; {text}"
    return text


@dataclass(slots=True)
class UnwrittenClaims:
    """The values that *node_plans* claim for *nodes* without writing them; all were read before."""

    session: Session
    nodes: Mapping[int, Node]
    node_plans: Sequence[NodePlan]
    _seen: dict[int, int] = field(default_factory=dict)

    def held(self) -> dict[int, tuple[Change, ...]]:
        """Read the file's values on each written node, and before a store all its PDOs.

        Each value is a change to itself. Raises the errors of reading PDOs for nodes that store.
        """
        written = [node_plan for node_plan in self.node_plans if len(node_plan.plan)]
        stores = [node_plan.node_id for node_plan in written if node_plan.stores and changes_a_pdo(node_plan.plan)]
        self._side_by_side([partial(_read_pdos, self.nodes[node_id]) for node_id in stores])
        return {
            node_plan.node_id: _held(self.nodes[node_plan.node_id], node_plan, beside=node_plan.node_id in stores)
            for node_plan in written
        }

    def verify(self) -> None:
        """Verify nodes without writes, and the unwritten settings of the file on the others.

        Raises Restarted if a node restarted and lost what was planned from, DeviceRefused if a value differs.
        """
        equal = self._equal()
        reads = [
            partial(_refuse_unequal, self.nodes[node_plan.node_id], node_plan)
            for node_plan in equal
            if node_plan.is_read
        ]
        reads += [
            partial(_refuse_altered, self.nodes[node_plan.node_id], node_plan)
            for node_plan in self.node_plans
            if node_plan.compared_values
        ]
        for _ in range(MAX_READS):
            self.verify_restarted()
            self._side_by_side(reads)
            restarted = [node_plan.node_id for node_plan in equal if self._has_restarted(node_plan)]
            if not restarted:  # what was read of the first ones may be lost by now
                return
        raise _restarts(restarted[0])

    def verify_restarted(self) -> None:
        """Raises Restarted if a node without writes restarted and lost what was planned from."""
        try:
            self.require_as_planned({node_plan.node_id for node_plan in self._equal()})
        except SafetyRefusal as lost:
            hint = "check its supply, then try again"
            raise Restarted(lost.text, node=lost.node, place=lost.place, why=lost.why, hint=hint) from lost

    def _equal(self) -> list[NodePlan]:
        """List the plans of nodes without writes, including nodes that store: they are read before the first store."""
        return [node_plan for node_plan in self.node_plans if not len(node_plan.plan)]

    def require_as_planned(self, of: Collection[int] | None = None) -> None:
        """Raises SafetyRefusal if a node of *of* (None: all) restarted and differs from what it was planned from."""
        for _ in range(MAX_READS):
            restarted = [
                node_plan
                for node_plan in self.node_plans
                if of is None or node_plan.node_id in of
                if self._has_restarted(node_plan)
            ]
            for node_plan in restarted:
                node = self.nodes[node_plan.node_id]
                self._seen[node_plan.node_id] = node.bus.boot_ups(node_plan.node_id)
                node.read_anew()
                node.observed(partial(_refuse_unlike, node, node_plan))
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
        for node_plan in self.node_plans:
            if not node_plan.compared_values:
                continue
            node = self.nodes[node_plan.node_id]
            try:
                altered = node.observed(partial(_altered, node, node_plan))
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

    def _has_restarted(self, node_plan: NodePlan) -> bool:
        now = self.nodes[node_plan.node_id].bus.boot_ups(node_plan.node_id)
        first = now if node_plan.boot_ups is None else node_plan.boot_ups
        return self._seen.setdefault(node_plan.node_id, first) != now


def _restarts(node_id: int) -> Restarted:
    return Restarted(f"node {node_id} restarted during each of {MAX_READS} reads", node=node_id)


def _refuse_unequal(node: ReadableNode, node_plan: NodePlan) -> None:
    """Raises DeviceRefused if *node*, which gets no write, no longer holds the file's values."""
    require_held(node, steady(node, node_plan.holds))


def _read_pdos(node: ReadableNode) -> None:
    node.known_pdos()


def _held(node: ReadableNode, node_plan: NodePlan, *, beside: bool) -> tuple[Change, ...]:
    """List what *node* holds and *node_plan* does not write; with *beside* also PDOs outside the file."""
    own = {change.pdo for change in node_plan.plan.changes if isinstance(change, PdoChange)}
    said = [change for change in steady(node, node_plan.holds) if _pdo_of(change) not in own]
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


def _refuse_altered(node: ReadableNode, node_plan: NodePlan) -> None:
    """Raises DeviceRefused if *node* altered settings of the file that were equal and got no write."""
    altered = node.observed(partial(_altered, node, node_plan))
    if altered:
        raise DeviceRefused(
            f"node {node.node_id} changed {join_some(altered)} as a side effect of the written values",
            node=node.node_id,
            why=join_some(altered.values()),
            hint="these settings depend on each other in this device: see its manual",
        )


def _altered(node: ReadableNode, node_plan: NodePlan) -> dict[str, str]:
    """Map altered settings to their difference, except those that change by themselves."""
    differing = {
        change: found
        for change in node_plan.compared_claims
        if _is_steady(node, change) and (found := first_difference(node.sdo, change))
    }
    if differing:
        node.bus.sleep(PAUSE_S)
    return {change.label: found for change, found in differing.items() if first_difference(node.sdo, change) == found}


def refuse_stale(
    node: ReadableNode, node_plan: NodePlan, changes: Collection[Change], what: str = "has changed"
) -> None:
    """Raises SafetyRefusal if *node* is another device than planned or *changes* would replace new values.

    *what* completes the message: what happened to the value.
    """
    if node.identity() != node_plan.identity:
        raise _stale(node, "is another device than the plan is for")
    look = node.read_cache.look()
    for change in changes:
        difference = first_difference(look, change, wanted_before=True)  # empty when the claim was made
        if difference:
            raise _stale(node, f"{what} since the plan was made: {change.label}", change.label, difference)


def _refuse_unlike(node: ReadableNode, node_plan: NodePlan) -> None:
    """Raises SafetyRefusal if *node* restarted and differs from *node_plan*, or was not checked since."""
    if not node_plan.is_read:
        raise _stale(node, "restarted after its stamp was used instead of a read")
    refuse_stale(node, node_plan, (*node_plan.plan.changes, *node_plan.holds), "restarted, and has changed")


def _stale(node: NodeDescription, what: str, place: str | None = None, why: str | None = None) -> SafetyRefusal:
    hint = Hint(Action.PLAN, {"node": None}, "again, and check the changed values")
    return SafetyRefusal(f"node {node.node_id} {what}", node=node.node_id, place=place, why=why, hint=hint)
