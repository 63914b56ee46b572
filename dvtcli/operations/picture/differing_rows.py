"""What nodes hold otherwise than a network file says, row by row. Reads nodes, writes nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.domain.network.picture import PictureDifference
from dvtcli.domain.parameter_text import parameter_text
from dvtcli.domain.plan import PdoChange
from dvtcli.operations.results.networks import action, differing

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import NodePlan
    from dvtcli.domain.plan import ValueChange
    from dvtcli.operations.session.session import Session


def differences(session: Session, file: str) -> Iterator[PictureDifference]:
    """Every parameter that is not as the network *file* says; raises as `plan_network`."""
    from dvtcli.operations.plans.plan_network import plan_network

    for node in plan_network(session, file).nodes:
        for change in node.plan.changes:
            yield from _of_pdo(node, change) if isinstance(change, PdoChange) else _of_object(node, change)


def _of_pdo(node: NodePlan, change: PdoChange) -> Iterator[PictureDifference]:
    if action(node, change) == "prune":
        yield PictureDifference(node.node_id, change.label, "enabled", "on", "off (not in the file)")
        return
    for key, was, will in differing(change):
        before, after = parameter_text(key, was, change.pdo), parameter_text(key, will, change.pdo)
        yield PictureDifference(node.node_id, change.label, key, before, after)


def _of_object(node: NodePlan, change: ValueChange) -> Iterator[PictureDifference]:
    step = change.step
    was, will = step.text(step.before), step.text(step.after)
    yield PictureDifference(node.node_id, f"0x{step.object}", "value", was, will)
