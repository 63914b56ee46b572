"""`load`: worst-case bus load of a network from its file or nodes, and the load measured. Only reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_state import NetworkState
from dvtcli.domain.network.worst_case_load import WhatIf, fitting_bit_rates, streams_of, worst_case_load
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.network.live_network import answering, has_bus, listen, present, refuse_without_bus
from dvtcli.operations.plans.network_states import network_after, network_state
from dvtcli.operations.results.networks import Measured, NetworkLoad

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.domain.network.worst_case_load import WorstCaseLoad
    from dvtcli.operations.session.session import Session, SessionNodes

#: Default bit rate of a bus, in bit/s; reported with the result.
USUAL_BIT_RATE = 500_000
MEASURED_S = 3.0
#: what stands beside the values of a network file
_DEFAULTS = "what the file does not say has the default of the EDS; with a bus, the nodes are asked"
_HOW = "NODE:tpdoN=MS, such as 5:tpdo3=40; NODE is a node-ID, or a name in the file"


@dataclass(frozen=True, slots=True)
class LoadOptions:
    """Options of `load`.

    *for_s* is the time of measurement in seconds (0: none), *bit_rate* (bit/s) replaces the bus's. *sync_ms* and
    *emcy_ms* are periods in ms to assume, *inhibit* inhibit times in 100 µs by TPDO and node-ID or name in the file
    (None: the selected node).
    """

    for_s: float = MEASURED_S
    bit_rate: int | None = None
    sync_ms: float | None = None
    emcy_ms: float | None = None
    inhibit: Mapping[tuple[int | str | None, Pdo], int] = field(default_factory=dict)


def network_load(session: Session, file: str | None = None, options: LoadOptions | None = None) -> NetworkLoad:
    """Compute the worst-case load by the network *file* or the nodes on the bus, and measure the bus.

    Without a bus only the file counts, its nodes as in `described_network`; raises UsageError without either,
    InputFileError with all errors of the file.
    """
    options = options or LoadOptions()
    if file is None:
        refuse_without_bus(session)
    measured = _measured(session, options.for_s) if has_bus(session) else None
    state = session.read_together(lambda: _state(session, file, measured))
    told = options.bit_rate or (session.wire.bitrate if session.is_open else None) or session.options.bitrate
    told = told or state.bit_rate
    bit_rate = told or USUAL_BIT_RATE
    found = streams_of(state, _what_if(session, state, options))
    if file is not None and measured is None and len(state.undescribed) < len(state.nodes):
        found = found._replace(assumed=(*found.assumed, _DEFAULTS))
    bus = session.wire.name if measured is not None else ""
    return NetworkLoad(
        worst_case_load(found, bit_rate),
        fitting_bit_rates(found),
        file or "",
        bus,
        is_assumed=told is None,
        measured=measured,
    )


def _state(session: Session, file: str | None, measured: Measured | None) -> NetworkState:
    if file is None:
        return network_state(answering(session, present(session, () if measured is None else measured.count.by_id)))
    if measured is None:
        from dvtcli.operations.network.described_network import described_network

        return described_network(file, session.reporter)
    from dvtcli.files.network.file_log import FileLog
    from dvtcli.files.network.read_network import network_text
    from dvtcli.operations.plans.plan_network import plan_network_config
    from dvtcli.operations.plans.read_network_config import read_network_config

    config = read_network_config(file)
    network_plan = plan_network_config(session, config, FileLog(file, network_text(file)))
    return network_after(
        network_state(session.node(node_plan.node_id) for node_plan in network_plan.nodes), network_plan, config
    )


def _measured(session: SessionNodes, for_s: float) -> Measured:
    """Measure the traffic on the bus for *for_s* seconds."""
    from dvtcli.watch.statistics import FrameCount

    count = FrameCount()
    received = listen(session, for_s, lambda frame, _sent: count.add(frame))
    return Measured(count, received.seconds, received.error_frames, received.lost_frames)


def _what_if(session: SessionNodes, state: NetworkState, options: LoadOptions) -> WhatIf:
    inhibit: dict[Endpoint, int] = {}
    for (node, pdo), time in options.inhibit.items():
        having = [node_state for node_state in state.nodes if pdo in node_state.pdos]
        chosen = session.selected_id() if node is None and len(having) > 1 else node
        having = [node_state for node_state in having if chosen in {None, node_state.node_id, node_state.name}]
        ends = [Endpoint(node_state.node_id, pdo) for node_state in having]
        if len(ends) != 1:
            who = "" if node is None else f"{node}:"
            several_nodes = "which node's?" if ends else "no node of the network has it"
            raise UsageError(
                several_nodes,
                given={"inhibit": f"{who}{pdo}"},
                hint=_HOW,
            )
        inhibit[ends[0]] = time
    return WhatIf(_us(options.sync_ms), _us(options.emcy_ms), inhibit)


def _us(time_ms: float | None) -> int | None:
    return None if time_ms is None else round(time_ms * 1000)


def load_after(session: SessionNodes, network_plan: NetworkPlan) -> WorstCaseLoad | None:
    """Compute the worst-case bus load after *network_plan*; None if the bit rate is unknown.

    Reads all PDOs of its nodes; None if a node cannot, or must not, be read.
    """
    bit_rate = session.wire.bitrate or session.options.bitrate
    if bit_rate is None or network_plan.unread:
        return None
    try:
        state = network_state(session.node(node_plan.node_id) for node_plan in network_plan.nodes)
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return None
    return worst_case_load(streams_of(network_after(state, network_plan)), bit_rate)
