"""Carry out or undo plans on several nodes together, phase by phase, all or nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Protocol

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.applied import Applied
from dvtcli.device.change.apply_plan import enter
from dvtcli.device.change.change_group import GroupMember
from dvtcli.device.change.combined_plan import combine_plans
from dvtcli.device.change.expected_refusals import foreseen, with_undo_findings
from dvtcli.device.change.own_journal import complete_groups
from dvtcli.device.change.roll_back import first_difference
from dvtcli.device.change.undo_plan import UndoPlan, UndoRequest, plan_undo, refuse_unknown
from dvtcli.device.change.untouched_pdos import as_they_are, untouched_configs, untouched_pdos
from dvtcli.device.stamped import is_stamp
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_plan import phases
from dvtcli.domain.objects import VERIFY_CONFIGURATION
from dvtcli.domain.plan import Change, PdoChange, Plan, ValueChange, plan_pdo
from dvtcli.domain.text import all_nodes
from dvtcli.errors import BusUnavailable, DeviceRefused, Interrupted, Restarted, SafetyRefusal
from dvtcli.operations.changes.change import change_result
from dvtcli.operations.changes.network_transaction import NetworkTransaction

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Progress
    from dvtcli.device.change.change_group import Storing
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


def apply_together(
    session: Session,
    nodes: Mapping[int, Node],
    plans: Mapping[int, Plan],
    initial_states: Mapping[int, InitialState],
    name: str,
    findings: Mapping[int, tuple[Finding, ...]],
    besides: BesidesPlans | None = None,
) -> NetworkTransaction:
    """Carry out every phase of *plans* on all *nodes*, each as *initial_states*; *name* is the name of the change.

    The values claimed *besides* are verified with the plans, and rolled back with them. If nodes store next, no
    roll-back is possible after that: a request to stop received during verification still counts, and if several nodes
    store, each is verified once more.

    Raises any error of a node with state `rolled_back` after all nodes were rolled back; LeftChanged if a roll-back
    failed. *findings* are those of the rules for each node.
    """
    besides = besides or BesidesPlans()
    boot_ups = {node_id: initial_state.boot_ups for node_id, initial_state in initial_states.items()}
    transaction = NetworkTransaction(session, nodes, name, boot_ups, held=dict(besides.held))
    try:
        for node_id, plan in plans.items():
            if len(plan):
                transaction.plans[node_id], _ = with_undo_findings(nodes[node_id], plan)
                own = untouched_pdos(nodes[node_id], transaction.guarded(node_id))
                read = untouched_configs(nodes[node_id], plan, initial_states[node_id])
                transaction.untouched[node_id] = as_they_are(
                    {pdo: config for pdo, config in read.items() if pdo in own}
                )
    except BaseException:
        with transaction:  # nothing was written: the change ends, so that the next one is not taken for a part of it
            raise
    run = _Run(session, transaction, initial_states, findings, sum(map(len, transaction.plans.values())))
    boot_ups = {node_id: boot_ups[node_id] for node_id in plans}
    try:
        _open_journals(transaction, initial_states, besides)
        faults = run.phases(plans)
        for _ in range(2 if len(besides.stores) > 1 else 1):
            faults = faults or final_verify(session, nodes, transaction.claims_by_node(), boot_ups, besides.others)
        if besides.stores:
            faults = faults or one_by_one([partial(_stop_if_cancelled, session, "before any node stored")])
    except BaseException as fault:  # a bug of ours must not leave a network half configured either
        with transaction:
            transaction.roll_back([fault])
        raise
    if faults:
        with transaction:
            transaction.roll_back(faults)
        raise faults[0]
    return transaction


def _open_journals(
    transaction: NetworkTransaction, initial_states: Mapping[int, InitialState], besides: BesidesPlans
) -> None:
    """Open the journals of all nodes before the first write, with room for all their later contents.

    A node has a single journal for all its parts: each further journal would make all nodes wait for the disk.
    """
    nodes = all_nodes([store.node_id for store in besides.stores]) if besides.stores else ""
    longest = GroupMember(  # only its length counts
        final=f"{transaction.name}: store on {nodes}; stored on {nodes}", stores=besides.stores, equal=besides.equal
    )
    only_store = {store.node_id: Plan(store.node_id, store.holds) for store in besides.stores if store.holds}
    written = {
        node_id: plan for node_id, plan in only_store.items() if besides.proves or any(map(is_stamp, plan.changes))
    }
    for node_id, plan in {**written, **transaction.plans}.items():
        node = transaction.nodes[node_id]
        if node.guard is not None:
            node.guard.own_journal.also_cover(Plan(node_id, tuple(transaction.held.get(node_id, ()))))
            node.guard.prepare(
                plan,
                node.identity(),
                initial_states[node_id].state,
                node.known_pdos,
                node.last_read,
                longest,
                proves=besides.proves,
            )


#: the phases in words
_PHASES = ("producers off", "consumers off", "writing", "consumers on", "producers on")


@dataclass(slots=True)
class _Run:
    """The parts of *transaction* in progress, *total* writes; parallel within a phase if the bus allows it."""

    session: Session
    transaction: NetworkTransaction
    initial_states: Mapping[int, InitialState]
    findings: Mapping[int, tuple[Finding, ...]]
    total: int
    taken: int = 0

    def phases(self, plans: Mapping[int, Plan]) -> list[BaseException]:
        """Carry out the phases, up to the first failure; returns the errors."""
        for number, phase in enumerate(phases(plans.values())):
            faults = self._side_by_side([partial(self._part, number, part) for part in phase])
            if faults:
                return faults
        return []

    def _side_by_side(self, jobs: list[Callable[[], None]]) -> list[BaseException]:
        return self.session.bus.side_by_side(jobs)

    def _part(self, phase: int, part: Plan) -> None:
        """Carry out *part*; noted beforehand, as a failure after its verification must roll it back, too."""
        node = self.transaction.nodes[part.node_id]
        changes = self.transaction.plans[part.node_id].changes
        part = replace(part, looked_at=frozenset(change.pdo for change in changes if isinstance(change, PdoChange)))
        with self._told(phase, node):
            _stop_if_cancelled(self.session)
            with self.transaction.doing(with_undo_findings(node, part)[0]):
                node.apply(
                    part,
                    self.findings[part.node_id],
                    force=self.session.options.force,
                    remembered=False,
                    initial_state=self.initial_states[part.node_id],
                    is_part_of_group=True,
                )

    @contextmanager
    def _told(self, phase: int, node: Node) -> Iterator[None]:
        """Count the steps of a part of *phase* (0..4) on *node* as steps of the whole change.

        Interrupted says how far the whole change had come.
        """
        reporter = node.on_step

        def took(progress: Progress) -> None:
            self.taken += 1
            reporter(replace(progress, done=self.taken, total=self.total))

        node.on_step = took
        try:
            yield
        except (Interrupted, KeyboardInterrupt) as fault:
            raise self._stopped(fault, phase, node.node_id) from fault
        finally:
            node.on_step = reporter

    def _stopped(self, fault: Interrupted | KeyboardInterrupt, phase: int, node_id: int) -> Interrupted:
        at_once = " at once" if not isinstance(fault, Interrupted) or fault.text.startswith("stopped at once") else ""
        where = f"at node {node_id}, phase {phase + 1} of 5 ({_PHASES[phase]})"
        text = f"stopped{at_once} {where}, after write {self.taken} of {self.total}"
        return self.session.cancellation.interrupted(
            text, node=node_id, state=fault.state if isinstance(fault, Interrupted) else "unchanged"
        )


def _stop_if_cancelled(session: SessionUser, where: str = "before the next part") -> None:
    if session.cancellation.requested:
        raise session.cancellation.interrupted(f"stopped {where}")


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
    with session.cancellation.deferred():
        initial_states = {node_id: node.begin_change() for node_id, node in sorted(nodes.items())}
        force = session.options.force
        undo_plans = {
            node_undoing.node.node_id: plan_undo(
                node_undoing.node,
                UndoRequest(
                    node_undoing.plans, everything=True, force=force, own=node_undoing.own, is_part_of_group=True
                ),
            )
            for node_undoing in undoings
        }
        if not force and not any(undo_plan.plan.changes for undo_plan in undo_plans.values()):
            for undo_plan in undo_plans.values():
                refuse_unknown(undo_plan)
        for node_id, undo_plan in undo_plans.items():
            if len(undo_plan.plan):
                enter(nodes[node_id], initial_states[node_id])  # whoever is asked is asked before the first write
        plans = {node_id: undo_plan.plan for node_id, undo_plan in undo_plans.items()}
        findings = {node_id: undo_plan.unknown for node_id, undo_plan in undo_plans.items()}
        held = {node_id: _as_before(undo_plan) for node_id, undo_plan in undo_plans.items()}
        written = [node_id for node_id, undo_plan in undo_plans.items() if len(undo_plan.plan)]
        for fault in session.bus.side_by_side([partial(_read_pdos, nodes[node_id]) for node_id in written]):
            raise fault
        for node_id in written:
            held[node_id] += _untouched(nodes[node_id], Plan(node_id, (*plans[node_id].changes, *held[node_id])))

        equal = {node_id: held[node_id] for node_id, undo_plan in undo_plans.items() if not len(undo_plan.plan)}
        besides = BesidesPlans(held, others=_EqualNodes(nodes, equal))
        with apply_together(session, nodes, plans, initial_states, "undo of all", findings, besides) as transaction:
            complete_groups(transaction.journals())
    done = []
    for undoing in undoings:
        node, undo_plan = undoing.node, undo_plans[undoing.node.node_id]
        applied = Applied(undo_plan.plan, (*undo_plan.unknown, *undoing.findings), unrestored=undo_plan.unrestored)
        lines = undoing.forget(applied, len(undo_plan.undone))
        done.append(change_result(session, node, applied, time.monotonic() - started, undone=True, lines=lines))
    return tuple(done)


class NoOtherClaims:
    """No claims of nodes without writes."""

    def verify(self) -> None:
        """Do nothing."""

    def verify_restarted(self) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True)
class _EqualNodes(NoOtherClaims):
    """Nodes that already hold their old values: nothing is written, and *held* is claimed."""

    nodes: Mapping[int, Node]
    held: Mapping[int, Sequence[Change]]

    def verify(self) -> None:
        for node_id, changes in self.held.items():
            require_held(self.nodes[node_id], changes)


def _as_before(undo_plan: UndoPlan) -> tuple[Change, ...]:
    """List values that are as before the changes of *undo_plan* and need no write, each as a change."""
    written = {change.label for change in undo_plan.plan.changes if change.steps}
    changes = combine_plans(undo_plan.plan.node_id, undo_plan.undone).changes if undo_plan.undone else ()
    return tuple(_to_the_same(change) for change in changes if change.label not in written and _is_undone(change))


def _read_pdos(node: ReadableNode) -> None:
    node.known_pdos()


def _untouched(node: ReadableNode, plan: Plan) -> tuple[Change, ...]:
    """List the PDOs of *node* outside *plan*: the undo may have side effects on them."""
    present = untouched_pdos(node, plan)
    return as_they_are({pdo: config for pdo, config in node.last_read.items() if pdo in present})


def _is_undone(change: Change) -> bool:
    """Tell whether the old value is known and returns with the undo; a stamp does not."""
    return isinstance(change, PdoChange) or (change.is_readable and change.step.index != VERIFY_CONFIGURATION)


def _to_the_same(change: Change) -> Change:
    if isinstance(change, PdoChange):
        return plan_pdo(change.pdo, change.before, change.before)
    return ValueChange(change.step.otherwise(change.step.before, change.step.before or b"", change.step.reason))


Changes = Mapping[int, Sequence["Change"]]


class OtherClaims(Protocol):
    """Claims about nodes and settings of a change that it does not write, such as equal nodes."""

    def verify(self) -> None:
        """Read all claims; raises Restarted if a node lost them by a restart, DeviceRefused if a value differs."""

    def verify_restarted(self) -> None:
        """Read the claims of nodes that restarted since their last read again; raises as `verify`."""


def final_verify(
    session: SessionNodes,
    nodes: Mapping[int, ReadableNode],
    changes: Changes,
    boot_ups: Mapping[int, int],
    others: OtherClaims | None = None,
) -> list[BaseException]:
    """Read all claimed values and return the faults: a restart since *boot_ups*, or another value.

    *changes* are the claims by node-ID. Every node is read, since not every restart sends a boot-up message. *others*
    are read first: a restart without a received boot-up message shows in the written values.
    """
    others = others or NoOtherClaims()
    require_not_restarted = partial(_require_not_restarted, nodes, boot_ups)
    return (
        one_by_one([require_not_restarted, others.verify])
        or session.bus.side_by_side([partial(require_held, nodes[node_id], some) for node_id, some in changes.items()])
        or one_by_one([others.verify_restarted, require_not_restarted])  # the first nodes may have lost theirs by now
    )


@dataclass(frozen=True, slots=True)
class BesidesPlans:
    """What a change of several nodes claims besides its plans, and the *stores* that follow.

    *held* has unchanged values that each node must keep, by node-ID. *equal* are nodes that were as wanted and neither
    change nor store. *others* are claims about what is not written. *proves*: the stores are proved.
    """

    held: Mapping[int, Sequence[Change]] = field(default_factory=dict)
    stores: tuple[Storing, ...] = ()
    equal: tuple[Storing, ...] = ()
    proves: bool = False
    others: OtherClaims = field(default_factory=NoOtherClaims)


@dataclass(frozen=True, slots=True)
class ClaimsAtStore:
    """The *changes* that each node must hold before the first store and after the last.

    *identities* of the devices and *boot_ups* received from nodes that do not store are by node-ID.
    """

    session: Session
    nodes: Mapping[int, Node]
    changes: Changes
    identities: Mapping[int, Identity]
    boot_ups: Mapping[int, int] = field(default_factory=dict)
    others: OtherClaims = field(default_factory=NoOtherClaims)

    def verify_before_store(self, node_id: int) -> None:
        """Raises SafetyRefusal if *node_id* is another device than before, DeviceRefused if it lost values."""
        node = self.nodes[node_id]
        if self.identities.get(node_id, node.identity()) != node.identity():
            raise SafetyRefusal(
                f"node {node_id} is another device than the one that was verified",
                node=node_id,
                hint=Hint(
                    Action.RECOVER,
                    {"discard": True},
                    "attach the one that was changed; {} sets the journal of one that is gone aside",
                ),
            )
        require_held(node, self.changes.get(node_id, ()))

    def verify_after_stores(self) -> list[BaseException]:
        """Return the faults of nodes that lost claimed values by the end of the stores."""
        try:
            now = {node_id: self.nodes[node_id].bus.boot_ups(node_id) for node_id in self.changes}
        except BusUnavailable as failed:
            return [failed]
        return final_verify(self.session, self.nodes, self.changes, {**now, **self.boot_ups})


def require_held(node: ReadableNode, changes: Sequence[Change]) -> None:
    """Raises DeviceRefused if *node*, read again, does not hold the last values of *changes*."""
    differences = node.observed(lambda: list(_lost(node, changes)))
    if differences:
        raise DeviceRefused(
            f"node {node.node_id} does not hold what was planned",
            node=node.node_id,
            why="; ".join(differences),
            hint="it restarted, or altered this beside a change of something else: check its supply and its manual",
        )


def _lost(node: ReadableNode, changes: Sequence[Change]) -> Iterator[str]:
    for change in changes:
        if difference := first_difference(node.sdo, change):
            yield f"{change.label}: {difference}"


def _require_not_restarted(nodes: Mapping[int, ReadableNode], boot_ups: Mapping[int, int]) -> None:
    """Raises Restarted if a node lost verified values while another node was changed."""
    again = [node_id for node_id, seen in boot_ups.items() if nodes[node_id].bus.boot_ups(node_id) != seen]
    if again:
        raise Restarted(
            f"{all_nodes(again)} restarted while the nodes were changed",
            node=again[0],
            hint="check its supply, then try again",
        )
