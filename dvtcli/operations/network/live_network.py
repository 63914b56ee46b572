"""Read a network on its bus: its traffic and its nodes. Sends nothing but SDO uploads."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.received_traffic import ReceivedTraffic
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.plans.network_states import network_state

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.network.network_state import Identifier, NetworkState
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import SessionNodes

_SLICE_S = 0.25
_OF_ONE_NODE = (range(0x081, 0x100), range(0x181, 0x200), range(0x281, 0x300), range(0x381, 0x400),
                range(0x481, 0x500), range(0x581, 0x600), range(0x701, 0x780))  # fmt: skip


class Listened(NamedTuple):
    """The time of recording (*seconds*), and damaged or lost frames."""

    seconds: float = 0.0
    error_frames: int = 0
    lost_frames: int = 0


def listen(session: SessionNodes, for_s: float, take: Callable[[Frame, bool], None]) -> Listened:
    """Pass every frame within *for_s* to *take*, with whether we sent it; nothing without frames."""
    bus = session.open_network().bus
    if not for_s or not bus.carries_frames:
        return Listened()
    for _ in bus.receive(0.0):
        pass  # frames from before: unlike nodes_seen(), this waits for a background thread that is late reading them
    errors, lost = bus.error_frame_count(), bus.lost_frame_count()
    untap = bus.tap(take)
    begun_s = bus.now_s()
    try:
        while (left_s := begun_s + for_s - bus.now_s()) > 0:
            session.reporter.progress("listening", round(10 * (for_s - left_s)), round(10 * for_s))
            bus.sleep(min(_SLICE_S, left_s))
    finally:
        untap()
    return Listened(bus.now_s() - begun_s, bus.error_frame_count() - errors, bus.lost_frame_count() - lost)


def received_traffic(
    session: SessionNodes, for_s: float, look: Callable[[Frame], None] | None = None
) -> ReceivedTraffic | None:
    """Record others' traffic for *for_s* seconds; None if recording is not possible. *look* gets each frame, too."""
    traffic = ReceivedTraffic()

    def take(frame: Frame, sent: bool) -> None:
        if not sent:
            traffic.add(frame)
            if look is not None:
                look(frame)

    listened = listen(session, for_s, take)
    traffic.seconds, traffic.error_frames = listened.seconds, listened.error_frames
    return traffic if listened.seconds else None


def live_state(session: SessionNodes, traffic: ReceivedTraffic | None, others: Collection[int] = ()) -> NetworkState:
    """Read the nodes `present` and *others*, with all that rules need."""
    received = () if traffic is None else traffic.by_id
    ids = sorted({*present(session, received), *others})
    return session.read_together(lambda: network_state(answering(session, ids), for_rules=True))


def refuse_without_bus(session: SessionNodes) -> None:
    """Open the bus; raises UsageError if no bus is chosen."""
    if nobody_chose(session):
        raise UsageError(
            "no FILE, and no bus",
            hint=Hint(Action.GIVE_INTERFACE, {"interface": "socketcan"}, "give a network file, or a bus: {}")
            + Hint(Action.GIVE_CHANNEL, {"channel": "can0"}, " {}")
            + Hint(Action.GIVE_SIMULATED, {"what": "gen4"}, ", or {}"),
        )
    session.open_network()


def nobody_chose(session: SessionNodes) -> bool:
    """Tell whether no bus is chosen, not even by python-can's settings."""
    from dvtcli.operations.user.settings import NOBODY

    return not has_bus(session) and session.chosen_by() == NOBODY


def has_bus(session: SessionNodes) -> bool:
    """Tell whether a bus is chosen."""
    options = session.options
    return session.is_open or bool(options.sim or options.interface or options.channel or options.bus)


def present(session: SessionNodes, received: Iterable[Identifier]) -> list[int]:
    """List the nodes that are known, *received* by a CAN-ID, or answer a scan.

    Not every node sends a heartbeat or a PDO. `-n` suppresses the scan, with a message.
    """
    network = session.network
    found = {*network.simulated_ids, *session.known_ids(), *network.scanned, *network.bus.nodes_seen()}
    for can_id, extended in received:
        if not extended and any(can_id in can_ids for can_ids in _OF_ONE_NODE):
            found.add(can_id & 0x7F)
    return sorted(found.union(_others(session)))


def _others(session: SessionNodes) -> list[int]:
    """Scan all node-IDs; empty if nobody else can be on the bus."""
    from dvtcli.operations.nodes.find_nodes import answering_ids

    bus, named = session.network.bus, session.base.nodes
    if bus.simulated:
        return []
    if named:
        who = f"node{'s' if len(named) > 1 else ''} {','.join(map(str, named))}"
        said = f"{who} as chosen, and known or received nodes; {{}} searches for the other nodes, too"
        session.reporter.note(Hint(Action.GIVE, {"node_id": "all"}, said))
        return []
    return answering_ids(bus)


def answering(session: SessionNodes, node_ids: Iterable[int]) -> list[Node]:
    """Return the *node_ids* whose PDOs can be read; reports the others."""
    nodes = []
    for node_id in node_ids:
        try:
            node = session.node(node_id)
            node.pdos()
            nodes.append(node)
        except (NoAnswer, SdoAborted, SdoProtocolError) as silent:
            session.reporter.note(f"node {node_id} is not counted: {silent.text}")
    return nodes
