"""`link` and `unlink` a TPDO and RPDOs, carried out like a network file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from dvtcli.device.read_pdos import read_optional
from dvtcli.device.seen_state import heartbeat_slots
from dvtcli.domain.cob_id import PRODUCES
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.links import watched_ms
from dvtcli.domain.network.network_config import (
    Endpoint,
    HeartbeatWatch,
    LinkConfig,
    NetworkConfig,
    NodeConfig,
    PartialPdoConfig,
)
from dvtcli.domain.network.worst_case_load import SYNCHRONOUS
from dvtcli.domain.objects import COB_ID_SYNC
from dvtcli.domain.rules.finding import warning
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.files.network.file_log import FileLog
from dvtcli.operations.plans.plan_network import plan_network_config

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.cob_id import CobId
    from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
    from dvtcli.operations.results.networks import NetworkApplied
    from dvtcli.operations.session.session import Session, SessionNodes

OnPlan = Callable[["NetworkPlan"], None]


def link_pdos(
    session: Session,
    producer: Endpoint,
    consumers: Sequence[Endpoint],
    *,
    heartbeat: int | Literal[False] | None = None,
    on_plan: OnPlan = lambda _plan: None,
) -> NetworkApplied:
    """Link the RPDOs *consumers* to the TPDO *producer*, on all nodes or on none; calls *on_plan* first.

    The TPDO keeps its CAN-ID if allowed, else gets a free CAN-ID. *heartbeat* is the producer's time in ms (1..65535);
    None keeps it, False adds no heartbeat consumer. Asks if a node is OPERATIONAL. Raises UsageError for ends that
    cannot be linked, RuleError if the layouts differ, else the errors of `apply`.
    """
    _refuse_ends(producer, consumers)
    ids = sorted({producer.node_id, *(end.node_id for end in consumers)})
    config = NetworkConfig(
        tuple(NodeConfig("", node_id) for node_id in ids), (LinkConfig(producer, tuple(consumers), heartbeat),)
    )
    return _carried_out(session, _spelled("link", producer, consumers), config, on_plan, producer)


def unlink_pdos(
    session: Session,
    producer: Endpoint,
    consumers: Sequence[Endpoint],
    *,
    heartbeat: bool = True,
    on_plan: OnPlan = lambda _plan: None,
) -> NetworkApplied:
    """Disable the RPDOs *consumers* of the TPDO *producer*, which stays enabled for other consumers.

    A node with no other link to the producer's node stops consuming its heartbeat, unless *heartbeat* is False. Raises
    UsageError if an RPDO does not receive the TPDO, else the errors of `apply`.
    """
    _refuse_ends(producer, consumers)
    sent = session.node(producer.node_id).pdo(producer.pdo).communication.cob_id
    nodes = []
    for node_id in sorted({end.node_id for end in consumers}):
        node, mine = session.node(node_id), [end for end in consumers if end.node_id == node_id]
        for end in mine:
            _refuse_unlinked(node, end, producer, sent)
        watches = _no_watches(session, node, mine, producer.node_id) if heartbeat else ()
        pdos = tuple(PartialPdoConfig(end.pdo, enabled=False) for end in mine)
        nodes.append(NodeConfig("", node_id, pdos=pdos, watches=watches))
    return _carried_out(session, _spelled("unlink", producer, consumers), NetworkConfig(tuple(nodes)), on_plan)


def _spelled(word: str, producer: Endpoint, consumers: Sequence[Endpoint]) -> str:
    return " ".join([word, *(f"{end.node_id}:{end.pdo}" for end in (producer, *consumers))])


def _refuse_ends(producer: Endpoint, consumers: Sequence[Endpoint]) -> None:
    """Raises UsageError if the ends cannot be linked."""
    hint = Hint(Action.LINK, {"producer": "NODE:tpdo1", "consumer": "NODE:rpdo2"})
    if not producer.pdo.is_tpdo:
        raise UsageError(f"{producer.node_id}:{producer.pdo} is not a TPDO: a link starts at a TPDO", hint=hint)
    if not consumers:
        raise UsageError("a link needs an RPDO that receives the TPDO", hint=hint)
    for number, end in enumerate(consumers):
        if end.pdo.is_tpdo:
            raise UsageError(f"{end.node_id}:{end.pdo} is not an RPDO: a link ends at RPDOs", hint=hint)
        if end in consumers[:number]:
            raise UsageError(f"{end.node_id}:{end.pdo} is named twice")


def _refuse_unlinked(node: ReadableNode, end: Endpoint, producer: Endpoint, sent: CobId) -> None:
    received = node.pdo(end.pdo).communication.cob_id
    if (received.can_id, received.extended) != (sent.can_id, sent.extended):
        names = [f"{endpoint.node_id}:{endpoint.pdo}" for endpoint in (end, producer)]
        raise UsageError(f"{names[0]} does not receive {names[1]}: it has CAN-ID {received}, the TPDO has {sent}")


def _no_watches(
    session: SessionNodes, node: ReadableNode, ends: Sequence[Endpoint], producer: int
) -> tuple[HeartbeatWatch, ...]:
    """Stop consuming the heartbeat of *producer* if *ends* are all its links with *node*."""
    if not watched_ms(heartbeat_slots(node.read_cache), producer):
        return ()
    cob_ids = session.node(producer).known_cob_ids()
    sent = {(cob_id.can_id, cob_id.extended) for pdo, cob_id in cob_ids.items() if pdo.is_tpdo and cob_id.valid}
    gone = {end.pdo for end in ends}
    for pdo, known_cob_id in node.known_cob_ids().items():
        if (
            not pdo.is_tpdo
            and pdo not in gone
            and known_cob_id.valid
            and (known_cob_id.can_id, known_cob_id.extended) in sent
        ):
            return ()
    return (HeartbeatWatch(producer, 0),)


def _carried_out(
    session: Session, name: str, config: NetworkConfig, on_plan: OnPlan, producer: Endpoint | None = None
) -> NetworkApplied:
    from dvtcli.operations.plans.apply_network import apply_network

    network_plan = plan_network_config(session, config, FileLog(name, ""), of_network=True)
    if producer is not None and not network_plan.unknown_syncs:
        network_plan = replace(
            network_plan,
            nodes=tuple(_with_sync_finding(session, node_plan, producer) for node_plan in network_plan.nodes),
        )
    on_plan(network_plan)
    return apply_network(session, network_plan, name=name, asks=False)


def _with_sync_finding(session: SessionNodes, node_plan: NodePlan, producer: Endpoint) -> NodePlan:
    """Warn in the plan of the *producer*'s node if its TPDO will be synchronous and no known node produces SYNC.

    Not if a node does not say whether it does.
    """
    if node_plan.node_id != producer.node_id:
        return node_plan
    wanted = node_plan.wanted.get(producer.pdo)
    kind = None if wanted is None else wanted.communication.transmission_type
    if kind not in SYNCHRONOUS or any(_may_produce_sync(session, node) for node in session.known_ids()):
        return node_plan
    place = f"0x{producer.pdo.communication_index:04X}:02"
    text = f"{producer.pdo.label} is synchronous (type {kind}), and no known node produces SYNC, for which it waits"
    found = warning("link-no-sync", place, text, Hint(Action.CHECK_SYNC, why="listens for SYNC"))
    return replace(node_plan, findings=(*node_plan.findings, found))


def _may_produce_sync(session: SessionNodes, node_id: int) -> bool:
    """Tell whether *node_id* produces SYNC, or cannot be asked."""
    try:
        cob_id = read_optional(session.node(node_id).read_cache, COB_ID_SYNC, 0, 4) or 0
    except (NoAnswer, SdoAborted, SdoProtocolError):
        return True
    return bool(cob_id & PRODUCES)
