"""Carrying out a plan for a network: all nodes get what was planned, or every one is as it was.

Decides nothing about what is legal (`plan_network`). Does not know files.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from dvtcli.device.change.course import combined
from dvtcli.device.change.put_back import first_difference
from dvtcli.device.change.taken_back import with_way_back
from dvtcli.domain.network.phases import phases
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.plan import Change, Plan
from dvtcli.domain.profile import PreOperational
from dvtcli.domain.script_line import change_lines
from dvtcli.domain.several import plural, several
from dvtcli.errors import DeviceRefused, Interrupted, JournalKept, Restarted, SafetyRefusal
from dvtcli.operations.other_master import refuse_other_master
from dvtcli.operations.results.networks import NetworkApplied
from dvtcli.operations.store_network import store_network
from dvtcli.operations.take_back_network import Course

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dvtcli.device.node import Node
    from dvtcli.device.observe import Found
    from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
    from dvtcli.operations.session import Session


def apply_network(
    session: Session, plan: NetworkPlan, *, prove: str | None = None, name: str = "", asks: bool = True
) -> NetworkApplied:
    """Carry *plan* out on all its nodes, in phases; with a fault on one of them every node is brought back.

    *name* is what it is called, `apply FILE` unless it is given. Asks first; without *asks* only where a node is
    OPERATIONAL. Once all nodes were read back equal those store whose file says so; with *prove* each is restarted then
    and compared (`reset`, `power`). SafetyRefusal where a node is not as it was planned from, or another master is
    heard; any error of a node with state `rolled_back`; LeftChanged where a node could not be brought back, or not all
    of them stored.
    """
    started = time.monotonic()
    planned = [one for one in plan.nodes if len(one.plan) or one.stores]
    nodes = {one.node_id: session.node(one.node_id) for one in plan.nodes}
    if planned:
        if asks or any(nodes[one.node_id].access.state() is NmtState.OPERATIONAL for one in planned):
            session.consent(_question(nodes, planned, f"{name}:" if name else "apply"))
        refuse_other_master(session)
    with session.cancellation.guard(), session.agreed():
        found = {node_id: node.claim() for node_id, node in sorted(nodes.items())}
        if not planned:  # what is as wanted may be what an interrupted change left
            return NetworkApplied(plan, session.dry_run, 0.0)
        for one in planned:
            refuse_stale(nodes[one.node_id], one, one.plan.changes)
        course = _carried_out(session, nodes, planned, found, name or f"apply {plan.file}")
        stored = store_network(session, course, [one for one in planned if one.stores], prove)
        _complete(course)
    return NetworkApplied(plan, session.dry_run, time.monotonic() - started, stored)


def _question(nodes: Mapping[int, Node], planned: list[NodePlan], name: str) -> str:
    writes = plural(sum(len(one.plan) for one in planned), "write")
    stores = [str(one.node_id) for one in planned if one.stores]
    store = f", and store on node {', '.join(stores)}" if stores else ""
    text = f"{name} {writes} to node {', '.join(str(one.node_id) for one in planned)}{store}?"
    running = [str(one.node_id) for one in planned if _leaves_operational(nodes[one.node_id])]
    if running:
        text = f"node {', '.join(running)} goes from OPERATIONAL to PRE-OPERATIONAL and back; {text}"
    return text


def _leaves_operational(node: Node) -> bool:
    required = node.profile.pre_operational_gate is PreOperational.REQUIRED
    return required and node.access.state() is NmtState.OPERATIONAL


def refuse_stale(node: Node, planned: NodePlan, changes: Iterable[Change]) -> None:
    """SafetyRefusal where *node* is another device than *planned* is for, or *changes* would replace something else."""
    hint = "plan again, and look at what has changed"
    if node.identity() != planned.identity:
        raise SafetyRefusal(f"node {node.node_id} is another device than the plan is for", node=node.node_id, hint=hint)
    for change in changes:
        difference = first_difference(node.sdo, change, wanted_before=True)
        if difference:
            raise SafetyRefusal(
                f"node {node.node_id} has changed since the plan was made: {change.label}",
                node=node.node_id,
                place=change.label,
                why=difference,
                hint=hint,
            )


def _carried_out(
    session: Session, nodes: Mapping[int, Node], planned: list[NodePlan], found: Mapping[int, Found], name: str
) -> Course:
    """Every phase on every node; on any fault everything is taken back, and the fault raised says so."""
    course = Course(session, nodes, name)
    for one in planned:
        if len(one.plan):
            course.plans[one.node_id], _ = with_way_back(nodes[one.node_id], one.plan)
    findings = {one.node_id: one.findings for one in planned}
    try:
        for phase in phases(one.plan for one in planned):
            for part in phase:
                _stop_if_cancelled(session, part)
                node = nodes[part.node_id]
                # noted before it is done: what fails once it was verified must be taken back, too
                course.done.append(with_way_back(node, part)[0])
                node.apply(
                    part, findings[part.node_id], force=session.options.force, kept=False, found=found[part.node_id]
                )
        changed = {one.node_id: nodes[one.node_id] for one in planned}
        _refuse_restarted(changed, found)
        _refuse_lost(nodes, course)
        _refuse_restarted(changed, found)  # once more: what was read of the first ones may be lost by now
    except BaseException as fault:  # a bug of ours must not leave a network half configured either
        course.take_back(fault)
        raise
    for node_id, plan in course.plans.items():
        nodes[node_id].keep(plan)
        if not session.dry_run:
            session.record.add(node_id, change_lines(plan))
    return course


def _stop_if_cancelled(session: Session, part: Plan) -> None:
    if session.cancellation.requested:
        stopped = Interrupted(f"stopped before {several(change.label for change in part.changes)}", node=part.node_id)
        stopped.exit_code = session.cancellation.exit_code
        raise stopped


def _refuse_lost(nodes: Mapping[int, Node], course: Course) -> None:
    """DeviceRefused where a node does not hold any more what was verified, while another one was changed.

    A node that restarts does not always say so: after the last write each is read back once more.
    """
    for node_id in course.plans:
        node, plan = nodes[node_id], combined(node_id, [part for part in course.done if part.node_id == node_id])
        differences = node.observed(lambda node=node, plan=plan: list(_lost(node, plan)))  # type: ignore[misc]
        if differences:
            raise DeviceRefused(
                f"node {node_id} lost what was set, while the network was changed",
                node=node_id,
                why="; ".join(differences),
                hint="it may have restarted: look at its supply, then try again",
            )


def _lost(node: Node, plan: Plan) -> Iterator[str]:
    for change in plan.changes:
        if difference := first_difference(node.sdo, change):
            yield f"{change.label}: {difference}"


def _refuse_restarted(nodes: Mapping[int, Node], found: Mapping[int, Found]) -> None:
    """Restarted where a node has lost what was verified, while another one was changed."""
    again = [node_id for node_id, node in nodes.items() if node.bus.boot_ups(node_id) != found[node_id].boot_ups]
    if again:
        raise Restarted(
            f"node {', '.join(map(str, again))} restarted while the network was changed",
            node=again[0],
            hint="look at its supply, then try again",
        )


def _complete(course: Course) -> None:
    """Everything stays; JournalKept where a journal cannot be removed."""
    kept: list[JournalKept] = []
    for journal in course.journals():
        try:
            journal.complete_whole()
        except JournalKept as failed:  # the journals of the other nodes are removed all the same
            kept.append(failed)
    course.end()
    if kept:
        kept[0].details += [("also", other.text) for other in kept[1:]]
        raise kept[0]
