"""Carrying out plans on several nodes together: phase by phase over all of them, and all or nothing.

Does not know what the plans are for: `apply_network` makes a network what a file says, `undo_together` takes changes
back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.change.course import combined
from dvtcli.device.change.put_back import first_difference
from dvtcli.device.change.taken_back import with_way_back
from dvtcli.domain.network.phases import phases
from dvtcli.domain.several import several
from dvtcli.errors import DeviceRefused, Interrupted, JournalKept, Restarted
from dvtcli.operations.take_back_network import Course

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dvtcli.device.node import Node
    from dvtcli.device.observe import Found
    from dvtcli.domain.plan import Plan
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.session import Session


def carry_out_together(
    session: Session,
    nodes: Mapping[int, Node],
    plans: Mapping[int, Plan],
    found: Mapping[int, Found],
    name: str,
    findings: Mapping[int, tuple[Finding, ...]],
) -> Course:
    """Every phase of *plans* on every one of *nodes*, as each was *found*; *name* is what that is called.

    Any error of a node with state `rolled_back`: everything is taken back then; LeftChanged where a node could not be.
    *findings* are what the rules had said of each.
    """
    course = Course(session, nodes, name)
    for node_id, plan in plans.items():
        if len(plan):
            course.plans[node_id], _ = with_way_back(nodes[node_id], plan)
    try:
        for phase in phases(plans.values()):
            for part in phase:
                _stop_if_cancelled(session, part)
                node = nodes[part.node_id]
                # noted before it is done: what fails once it was verified must be taken back, too
                course.done.append(with_way_back(node, part)[0])
                node.apply(
                    part, findings[part.node_id], force=session.options.force, kept=False, found=found[part.node_id]
                )
        changed = {node_id: nodes[node_id] for node_id in plans}
        _refuse_restarted(changed, found)
        _refuse_lost(nodes, course)
        _refuse_restarted(changed, found)  # once more: what was read of the first ones may be lost by now
    except BaseException as fault:  # a bug of ours must not leave a network half configured either
        course.take_back(fault)
        raise
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
                f"node {node_id} lost what was set, while the nodes were changed",
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
            f"node {', '.join(map(str, again))} restarted while the nodes were changed",
            node=again[0],
            hint="look at its supply, then try again",
        )


def complete(course: Course) -> None:
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
