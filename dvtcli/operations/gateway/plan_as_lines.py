"""A network's plan as gateway lines: what each node needs around its writes is looked up here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.store_parameters import STORE, chosen
from dvtcli.domain.gateway.plan_lines import Around, plan_lines
from dvtcli.domain.nmt import NmtState
from dvtcli.operations.consent.power_stage import refuse_powered
from dvtcli.operations.stores.possible_stores import store_group

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
    from dvtcli.operations.session.session import Session


def plan_as_lines(session: Session, plan: NetworkPlan, stores: Mapping[int, Sequence[str]] | None = None) -> str:
    """The text of a file with the lines that carry *plan* out; *stores*, by node-ID, where a node has several.

    Asks what `apply` would ask of another device than the file is about; SafetyRefusal where a power stage is on.
    """
    planned = [node for node in plan.nodes if len(node.plan) or node.stores]
    refuse_powered(session, [planned_node.node_id for planned_node in planned if planned_node.needs_power_off])
    for node_plan in planned:
        if node_plan.doubt:
            session.consent(f"{node_plan.doubt}; write the lines for it?")
    several = stores or {}
    around = {node.node_id: _around(session, node, several.get(node.node_id, (node.store,))) for node in plan.nodes}
    return "\n".join([*plan_lines(plan, around), ""])


def _around(session: Session, planned: NodePlan, stores: Sequence[str]) -> Around:
    node = session.node(planned.node_id)
    if not (len(planned.plan) or planned.stores):
        return Around()
    required = node.is_pre_operational_wanted
    groups = [store_group(word) for word in stores] if planned.stores else []
    chose = (chosen(node.access, node.profile.store, STORE, group, node.dictionary)[0] for group in groups)
    return Around(required, required and node.access.state() is NmtState.OPERATIONAL, tuple(dict.fromkeys(chose)))
