"""The bus load that a network plan leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.network.bus_need import bus_need
from dvtcli.domain.network.frame_streams import streams_of
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError
from dvtcli.operations.plans.network_states import network_after, network_state

if TYPE_CHECKING:
    from dvtcli.domain.network.bus_need import BusNeed
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.operations.session.session_nodes import SessionNodes


def load_after(session: SessionNodes, plan: NetworkPlan) -> BusNeed | None:
    """Compute the worst-case bus load after *plan*; None if the bit rate is unknown.

    Reads all PDOs of its nodes; None if a node cannot, or must not, be read.
    """
    bit_rate = session.wire.bitrate or session.options.bitrate
    if bit_rate is None or plan.unread:
        return None
    try:
        state = network_state(session.node(node.node_id) for node in plan.nodes)
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None
    return bus_need(streams_of(network_after(state, plan)), bit_rate)
