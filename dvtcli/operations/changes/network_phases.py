"""Carry out plans on several nodes together, phase by phase, all or nothing.

`apply_network` and `undo_together` make the plans.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.change_group import GroupMember
from dvtcli.device.change.expected_refusals import with_undo_findings
from dvtcli.device.change.untouched_pdos import as_they_are, untouched_configs, untouched_pdos
from dvtcli.device.stamped import is_stamp
from dvtcli.domain.network.network_plan import phases
from dvtcli.domain.plan import PdoChange, Plan
from dvtcli.errors import Interrupted
from dvtcli.operations.changes.change import AlsoExpected, final_verify
from dvtcli.operations.changes.network_transaction import NetworkTransaction

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from dvtcli.device.change.applied import Progress
    from dvtcli.device.node import Node
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.user.session_user import SessionUser


def apply_together(
    session: Session,
    nodes: Mapping[int, Node],
    plans: Mapping[int, Plan],
    initial_states: Mapping[int, InitialState],
    name: str,
    findings: Mapping[int, tuple[Finding, ...]],
    also: AlsoExpected | None = None,
) -> NetworkTransaction:
    """Carry out every phase of *plans* on all *nodes*, each as *initial_states*; *name* is the name of the change.

    The values *also* claimed are verified with the plans, and rolled back with them. If nodes store next, no roll-back
    is possible after that: a request to stop received during verification still counts, and if several nodes store,
    each is verified once more.

    Raises any error of a node with state `rolled_back` after all nodes were rolled back; LeftChanged if a roll-back
    failed. *findings* are those of the rules for each node.
    """
    also = also or AlsoExpected()
    boot_ups = {node_id: read_part.boot_ups for node_id, read_part in initial_states.items()}
    transaction = NetworkTransaction(session, nodes, name, boot_ups, held=dict(also.held))
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
        _open_journals(transaction, initial_states, also)
        faults = run.phases(plans)
        for _ in range(2 if len(also.stores) > 1 else 1):
            faults = faults or final_verify(session, nodes, transaction.claims(), boot_ups, also.others)
        if also.stores:
            faults = faults or one_by_one([partial(_stop_if_cancelled, session, "before any node stored")])
    except BaseException as fault:  # a bug of ours must not leave a network half configured either
        with transaction:
            transaction.take_back([fault])
        raise
    if faults:
        with transaction:
            transaction.take_back(faults)
        raise faults[0]
    return transaction


def _open_journals(
    transaction: NetworkTransaction, initial_states: Mapping[int, InitialState], also: AlsoExpected
) -> None:
    """Open the journals of all nodes before the first write, with room for all their later contents.

    A node has a single journal for all its parts: each further journal would make all nodes wait for the disk.
    """
    ids = ", ".join(str(store.node_id) for store in also.stores)
    ends = GroupMember(
        final=f"{transaction.name}: store on node {ids}; stored on node {ids}", stores=also.stores, equal=also.equal
    )
    only_store = {store.node_id: Plan(store.node_id, store.holds) for store in also.stores if store.holds}
    written = {node_id: plan for node_id, plan in only_store.items() if also.proves or any(map(is_stamp, plan.changes))}
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
                ends,
                proves=also.proves,
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
        stopped = Interrupted(text, node=node_id, state=fault.state if isinstance(fault, Interrupted) else "unchanged")
        stopped.exit_code = self.session.cancellation.exit_code
        return stopped


def _stop_if_cancelled(session: SessionUser, where: str = "before the next part") -> None:
    if session.cancellation.requested:
        stopped = Interrupted(f"stopped {where}")
        stopped.exit_code = session.cancellation.exit_code
        raise stopped
