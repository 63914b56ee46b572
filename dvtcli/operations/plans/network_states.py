"""The state of a network's nodes, read now or computed after a plan.

Writes nothing and judges nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_number, sdo_channels
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.objects import (
    BOOT_TIME,
    COB_ID_EMCY,
    COB_ID_SYNC,
    COB_ID_TIME,
    CONCISE_DCF,
    CONSUMER_HEARTBEAT,
    CYCLE_PERIOD,
    ERROR_BEHAVIOUR,
    EXPECTED_DEVICE_TYPE,
    EXPECTED_PRODUCT,
    EXPECTED_REVISION,
    EXPECTED_SERIAL,
    EXPECTED_VENDOR,
    GUARD_TIME,
    IDENTITY,
    INHIBIT_TIME_EMCY,
    LIFE_TIME_FACTOR,
    NMT_STARTUP,
    PRODUCER_HEARTBEAT,
    REQUEST_GUARDING,
    REQUEST_NMT,
    SLAVE_ASSIGNMENT,
    SYNC_OVERFLOW,
    SYNC_WINDOW,
)
from dvtcli.domain.pdo import PdoCommunicationParameter, PdoConfig
from dvtcli.domain.plan import PdoChange, ValueChange
from dvtcli.domain.profile import ObjectAddress
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.network.network_config import LinkConfig, NetworkConfig, NodeConfig
    from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.ports import SdoReader
    from dvtcli.operations.session.session import SessionNodes

#: Objects besides PDOs that a load depends on: index, sub-index, length in bytes.
TIMING = (
    (COB_ID_SYNC, 0, 4), (CYCLE_PERIOD, 0, 4), (SYNC_WINDOW, 0, 4), (SYNC_OVERFLOW, 0, 1), (GUARD_TIME, 0, 2),
    (LIFE_TIME_FACTOR, 0, 1), (COB_ID_TIME, 0, 4), (COB_ID_EMCY, 0, 4), (INHIBIT_TIME_EMCY, 0, 2),
    (PRODUCER_HEARTBEAT, 0, 2),
)  # fmt: skip
#: Further objects for the rules of `check`.
JUDGED = (
    *((IDENTITY, sub_index, 4) for sub_index in range(1, 5)), (ERROR_BEHAVIOUR, 1, 1), (NMT_STARTUP, 0, 4),
)  # fmt: skip
#: Objects of an NMT master for the rules: an entry per node, lengths in bytes.
_OF_MASTER = {
    SLAVE_ASSIGNMENT: 4, REQUEST_NMT: 1, REQUEST_GUARDING: 1, EXPECTED_DEVICE_TYPE: 4,
    EXPECTED_VENDOR: 4, EXPECTED_PRODUCT: 4, EXPECTED_REVISION: 4, EXPECTED_SERIAL: 4,
}  # fmt: skip


def node_state(node: ReadableNode, *, for_rules: bool = False, only_enabled: bool = False) -> NodeState:
    """Read the state of *node*; *for_rules* adds the data for the rules of `check`. Raises as its reads do.

    *only_enabled* skips disabled PDOs.
    """
    pdos = dict(node.known_enabled_pdos() if only_enabled else node.known_pdos())
    places = (*TIMING, *(JUDGED if for_rules else ()))
    numbers = node.observed(lambda: dict(_numbers(node.read_cache.look(), places, {CONSUMER_HEARTBEAT: 4})))
    if for_rules:
        if (NMT_STARTUP, 0) in numbers:  # a node without it is no NMT master, and cannot become one
            numbers |= node.observed(lambda: dict(_numbers(node.read_cache.look(), ((BOOT_TIME, 0, 4),), _OF_MASTER)))
        numbers |= node.observed(lambda: sdo_channels(node.read_cache.look(), node.dictionary))
    downloads = node.observed(lambda: dict(_downloads(node.read_cache))) if numbers.get((NMT_STARTUP, 0)) else {}
    return NodeState(node.node_id, "", pdos, numbers, node.dictionary, node.profile, node.title, downloads=downloads)


def states_of(session: SessionNodes, nodes: Sequence[ReadableNode]) -> NetworkState:
    """Read, in parallel, the data of *nodes* for the rules of `check`; raises as their reads do."""
    found: list[NodeState] = []

    def read(node: ReadableNode) -> None:
        found.append(node_state(node, for_rules=True, only_enabled=True))

    for fault in session.bus.side_by_side([partial(read, node) for node in nodes]):
        raise fault
    return NetworkState(tuple(sorted(found, key=lambda state: state.node_id)))


def states_beside(session: SessionNodes, read: Collection[int]) -> list[NodeState]:
    """Return the CAN-IDs used by other known or simulated nodes; leaves out the nodes in *read*.

    Only the COB-IDs of their PDOs are read. A node without an answer uses none.
    """
    network, found = session.network, []
    for node_id in sorted({*network.nodes, *network.simulated_ids} - {*read}):
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):
            node = network.node(node_id)
            cob_ids = node.known_cob_ids().items()
            pdos = {pdo: PdoConfig(PdoCommunicationParameter(cob_id), ()) for pdo, cob_id in cob_ids}
            services = ((index, 0, 4) for index in (COB_ID_SYNC, CYCLE_PERIOD, COB_ID_TIME, COB_ID_EMCY))
            numbers = {
                **dict(_numbers(node.read_cache, services, {})),
                **sdo_channels(node.read_cache, node.dictionary),
            }
            found.append(NodeState(node_id, "", pdos, numbers, node.dictionary, node.profile, node.title))
    return found


def timing_numbers(sdo: SdoReader) -> dict[ObjectAddress, int]:
    """Read the numbers besides PDOs that a bus load depends on, if the node has them."""
    return dict(_numbers(sdo, TIMING, {CONSUMER_HEARTBEAT: 4}))


def _downloads(sdo: SdoReader) -> Iterator[tuple[int, bytes]]:
    """List what a manager downloads to each node at its boot-up (0x1F22), if readable."""
    for node_id in range(1, min(_number(sdo, CONCISE_DCF, 0, 1) or 0, 127) + 1):
        try:
            data = sdo.upload(CONCISE_DCF, node_id)
        except (SdoAborted, SdoProtocolError):
            continue
        if any(data):
            yield node_id, data


def _numbers(
    sdo: SdoReader, places: Iterable[tuple[int, int, int]], arrays: Mapping[int, int]
) -> Iterator[tuple[ObjectAddress, int]]:
    for index, sub_index, size in places:
        if (value := _number(sdo, index, sub_index, size)) is not None:
            yield (index, sub_index), value
    for index, size in arrays.items():
        for sub_index in range(1, (_number(sdo, index, 0, 1) or 0) + 1):
            if (value := _number(sdo, index, sub_index, size)) is not None:
                yield (index, sub_index), value


def _number(sdo: SdoReader, index: int, sub_index: int, size: int) -> int | None:
    """Read a number; None if the node does not return it, for any reason."""
    try:
        return read_number(sdo, index, sub_index, size)
    except (SdoAborted, SdoProtocolError):
        return None


def network_state(nodes: Iterable[ReadableNode], *, for_rules: bool = False) -> NetworkState:
    """Read the state of *nodes*; raises as their reads do."""
    states = (node_state(node, for_rules=for_rules) for node in nodes)
    return NetworkState(tuple(sorted(states, key=lambda state: state.node_id)))


def network_after(state: NetworkState, network_plan: NetworkPlan, config: NetworkConfig | None = None) -> NetworkState:
    """Compute *state* after *network_plan*; *config* is the plan's origin, if known."""
    node_plans = {node_plan.node_id: node_plan for node_plan in network_plan.nodes}
    configured = {node.node_id: node for node in config.nodes} if config else {}
    nodes = (_node_after(node, node_plans.get(node.node_id), configured.get(node.node_id)) for node in state.nodes)
    links = () if config is None else config.links
    return state._replace(
        nodes=tuple(nodes),
        master=network_plan.master if config is None else config.master,
        links=links,
        file=network_plan.file,
    )


def _node_after(state: NodeState, node_plan: NodePlan | None, config: NodeConfig | None) -> NodeState:
    if node_plan is None:
        return state
    changes = node_plan.plan.changes
    pdos = {change.pdo: change.after for change in changes if isinstance(change, PdoChange)}
    steps = (change.step for change in changes if isinstance(change, ValueChange))
    written = {(step.index, step.sub_index): int.from_bytes(step.after, "little") for step in steps}
    after = replace(
        state, name=node_plan.name, pdos={**node_plan.wanted, **state.pdos, **pdos},
        numbers={**state.numbers, **written}, said=node_plan.findings,
    )  # fmt: skip
    if config is None:
        return after
    return replace(with_config(after, config), unresolved=frozenset(_unresolved(state.dictionary, node_plan, config)))


def _unresolved(dictionary: ObjectDictionary | None, node_plan: NodePlan, config: NodeConfig) -> Iterator[Pdo]:
    """Yield the PDOs that *config* maps and *node_plan* lacks, or maps with an object missing in *dictionary*."""
    for pdo in (pdo_config.pdo for pdo_config in config.pdos if pdo_config.mapping is not None):
        want = node_plan.wanted.get(pdo)
        entries = () if want is None or dictionary is None else want.mapping
        if want is None or any(
            not entry.is_dummy and dictionary is not None and dictionary.entry(entry.index, entry.sub_index) is None
            for entry in entries
        ):
            yield pdo


def with_link_marks(state: NetworkState, links: Sequence[LinkConfig]) -> NetworkState:
    """Add to *state* the file places of PDOs that are named only in *links*."""
    nodes = []
    for node in state.nodes:
        linked = {end.pdo: link.mark for link in links for end in link.ends if end.node_id == node.node_id}
        nodes.append(replace(node, marks={**linked, **node.marks}) if linked else node)
    return state._replace(nodes=tuple(nodes))


def with_config(state: NodeState, config: NodeConfig) -> NodeState:
    """Add to *state* the file places of *config* and its identity."""
    asked = {name: getattr(config.identity, name) for name in ("vendor", "product", "revision", "serial")}
    marks = {pdo.pdo: pdo.mark for pdo in config.pdos}
    return replace(state, name=config.name, mark=config.mark, marks=marks, places=config.marks, asked=asked)
