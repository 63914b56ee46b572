"""Rules about frames received on a bus: SYNC, other masters, unknown producers; silent without recorded traffic."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.cob_id import SYNC_BY_DEFAULT
from dvtcli.domain.frame import byte_length
from dvtcli.domain.lint import ERROR, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, NetSpot, at, held
from dvtcli.domain.network.network_state import Identifier, NetworkState, identifier_of, identifier_text
from dvtcli.domain.network.received_traffic import ReceivedId
from dvtcli.domain.network.worst_case_load import EVENT_DRIVEN, Stream, most_frames
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import COB_ID_SYNC, PRODUCER_HEARTBEAT
from dvtcli.domain.standard_objects import source
from dvtcli.domain.text import join_some, plural

_SET = "CiA 301, 7.3.5: the pre-defined connection set"
_SYNC = "CiA 301, 7.2.5: one producer"
#: Waiting time in periods before a frame counts as missing.
_PATIENCE = 2.5
#: From so many SYNC messages on their times say something; so many of the gaps have to be short (share), below so much
#: of the long ones.
_ENOUGH, _SHORT_ONES, _SHORT = 8, 0.25, 0.6
#: CAN-IDs of services other than PDOs in the pre-defined connection set.
_SERVICES = (range(0x001), range(0x080, 0x101), range(0x580, 0x680), range(0x700, 0x780), range(0x7E4, 0x7E6))


def _sync_ids(state: NetworkState) -> set[Identifier]:
    return {node.sync for node in state.nodes} or {SYNC_BY_DEFAULT}


@check("sync-not-heard", ERROR, "PDOs are synchronous, but no SYNC was received", "CiA 301, 7.5.2.35 and 7.5.2.37")
def sync_not_heard(network: CheckedNetwork) -> NetFound:
    """Synchronous PDOs are never sent, and never take effect."""
    traffic, periods = network.traffic, network.state.sync_periods_us
    if traffic is None or not network.synchronous or any(map(traffic.count, _sync_ids(network.state))):
        return
    if traffic.seconds * 1_000_000 < _PATIENCE * max(periods, default=0):
        return
    listed = join_some(f"{node.node_id}:{pdo}" for node, pdo, _ in network.synchronous)
    node, pdo, _ = network.synchronous[0]
    yield at(node, pdo), f"no SYNC within {traffic.seconds:.1f} s; these PDOs wait for it: {listed}"


@check("sync-heard-twice", ERROR, "more SYNC messages were received than one producer sends", _SYNC)
def sync_heard_twice(network: CheckedNetwork) -> NetFound:
    """Synchronous PDOs come twice as often, at wrong times."""
    traffic = network.traffic
    for identifier in () if traffic is None else sorted(_sync_ids(network.state)):
        received = traffic.by_id.get(identifier) if traffic else None
        if received is None or traffic is None:
            continue
        why = _second_counter(received) or _more(network, "sync", identifier)
        if why:
            yield _sync_spot(network), f"{identifier_text(identifier)}: {why}"


def _sync_spot(network: CheckedNetwork) -> NetSpot:
    node = next((node for node in network.nodes if node.produces_sync), None)
    return NetSpot() if node is None else held(node, COB_ID_SYNC)


def _second_counter(received: ReceivedId) -> str:
    """Proof of a second producer in the frames' data, in words; empty without proof."""
    if len(received.lengths) > 1:
        return "some have a counter, others do not"
    counters = [first_byte for first_byte in received.first_bytes if first_byte is not None]
    jumps = sum(after not in (before + 1, 1) for before, after in pairwise(counters))
    return f"its counter jumps, {jumps} times of {len(counters) - 1}" if jumps > len(counters) // 4 else ""


@check("sync-uneven", WARNING, "SYNC comes at uneven intervals: there may be two producers", _SYNC)
def sync_uneven(network: CheckedNetwork) -> NetFound:
    """Two producers with the same period cause alternating short and long gaps."""
    for identifier in () if network.traffic is None else sorted(_sync_ids(network.state)):
        received = network.traffic.by_id.get(identifier) if network.traffic else None
        gaps = [] if received is None else sorted(received.gaps_s)
        if received is None or len(gaps) < _ENOUGH or _second_counter(received) or _more(network, "sync", identifier):
            continue
        typical_s = gaps[int(0.9 * len(gaps))]
        short = [gap for gap in gaps if gap < _SHORT * typical_s]
        if len(short) >= _SHORT_ONES * len(gaps):
            times = f"{1000 * gaps[0]:.1f} to {1000 * gaps[-1]:.1f} ms"
            yield NetSpot(), f"{identifier_text(identifier)} comes after {times}"


def _more(network: CheckedNetwork, kind: str, identifier: Identifier) -> str:
    """Frames of *kind* above the configured maximum, in words; empty for none."""
    traffic = network.traffic
    if traffic is None:
        return ""
    streams = _streams(network, kind, identifier)
    most = most_frames(streams, traffic.seconds) if streams else None
    if most is None or traffic.count(identifier) <= most:
        return ""
    rate = sum(1_000_000 / float(stream.frame.period_us) for stream in streams if stream.frame.period_us)
    return f"{traffic.rate_hz(identifier):.1f} a second were received, at most {rate:.1f} are expected"


def _streams(network: CheckedNetwork, kind: str, identifier: Identifier) -> list[Stream]:
    found = (stream for stream in network.streams.streams if stream.kind == kind)
    return [stream for stream in found if (stream.frame.can_id, stream.frame.extended) == identifier]


@check("comes-too-often", WARNING, "a TPDO is transmitted more often than its settings allow",
       "CiA 301, 7.5.2.37: inhibit time, event timer; SYNC")  # fmt: skip
def comes_too_often(network: CheckedNetwork) -> NetFound:
    """Another producer uses the CAN-ID, or the device ignores its configuration."""
    for node, pdo, config in network.tpdos:
        if why := _more(network, "tpdo", identifier_of(config)):
            yield at(node, pdo), why


@check("other-length", ERROR, "a TPDO was received with another length than it maps", _SET)
def other_length(network: CheckedNetwork) -> NetFound:
    """Another producer uses the CAN-ID."""
    for node, pdo, config in network.tpdos:
        received = None if network.traffic is None else network.traffic.by_id.get(identifier_of(config))
        is_known = config.has_mapping and not config.inconsistency and config.mpdo is None
        if received is not None and is_known and received.lengths != {byte_length(config.bits)}:
            lengths = join_some(str(length) for length in sorted(received.lengths))
            yield at(node, pdo), f"{lengths} bytes were received, it maps {byte_length(config.bits)}"


@check("not-heard", WARNING, "a TPDO with an event timer was not received although its node is OPERATIONAL",
       "CiA 301, 7.5.2.37: event timer")  # fmt: skip
def not_heard(network: CheckedNetwork) -> NetFound:
    """Consumers wait in vain."""
    traffic = network.traffic
    for node, pdo, config in () if traffic is None else network.tpdos:
        timer = config.communication.event_timer
        if traffic is None or not timer or config.communication.transmission_type not in EVENT_DRIVEN:
            continue
        is_running = traffic.states.get(node.node_id) == [NmtState.OPERATIONAL]
        if is_running and traffic.seconds * 1000 > _PATIENCE * timer and not traffic.count(identifier_of(config)):
            yield (
                at(node, pdo),
                f"its event timer is {timer} ms, but no frame was received within {traffic.seconds:.1f} s",
            )


@check("from-nobody", WARNING, "a frame was received that no node of the network transmits", _SET)
def from_nobody(network: CheckedNetwork) -> NetFound:
    """A controller without CANopen, another tool, or a node that was not read."""
    for identifier, received in () if network.traffic is None else sorted(network.traffic.by_id.items()):
        if identifier not in _known(network) and network.traffic is not None:
            hears = [f"{node.node_id}:{pdo}" for node, pdo, held in network.rpdos if identifier_of(held) == identifier]
            who = f"; {join_some(hears)} {'receive' if len(hears) > 1 else 'receives'} it" if hears else ""
            often = f"{network.traffic.rate_hz(identifier):.1f} a second" if received.frames > 1 else "once"
            yield (
                NetSpot(),
                f"{identifier_text(identifier)} was received, {often}, but no node that was read transmits it{who}",
            )


def _known(network: CheckedNetwork) -> set[Identifier]:
    """CAN-IDs that a node, or a service allowed in every network, sends."""
    own = {
        identifier
        for node in network.nodes
        for identifier in (node.sync, node.time, node.emcy)
        if identifier is not None
    }
    services = {(can_id, False) for can_ids in _SERVICES for can_id in can_ids}
    return own | services | network.sent


@check("other-master", WARNING, "another master talks to the nodes: NMT, LSS or SDO that is not ours",
       "CiA 301, 7.2.8.3.1; 7.2.4.3.1: one SDO client; CiA 305")  # fmt: skip
def other_master(network: CheckedNetwork) -> NetFound:
    """The other master may change values while dvtcli reads or changes them."""
    traffic = network.traffic
    if traffic is None:
        return
    for node_id, count in sorted(traffic.requests.items()):
        spot = NetSpot(node_id) if network.state.node(node_id) is not None else NetSpot()
        whom = "it" if spot.node_id else f"node {node_id}"
        yield spot, f"another SDO client asks {whom}: {plural(count, 'request')} that {_are(count)} not ours"
    for command, count in sorted(traffic.commands.items()):
        yield NetSpot(), f"NMT commands from an unknown sender: {command}{_often(count)}"
    if traffic.lss:
        yield NetSpot(), f"LSS commands from an unknown sender: {plural(traffic.lss, 'frame')}"


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _often(count: int) -> str:
    return "" if count == 1 else f", {count} times"


@check("node-id-twice", ERROR, "two nodes seem to have the same node-ID", "CiA 301, 7.3.4: node-IDs are unique")
def node_id_twice(network: CheckedNetwork) -> NetFound:
    """Both nodes answer each request, and one gets the other's configuration."""
    for node in network.nodes:
        for why in _signs_of_two(network, node.node_id):
            yield at(node), why


def _signs_of_two(network: CheckedNetwork, node_id: int) -> Iterator[str]:
    traffic = network.traffic
    if traffic is None:
        return
    period_is_known = node_id not in traffic.heartbeat_written
    if period_is_known and (why := _more(network, "heartbeat", (HEARTBEAT_BASE + node_id, False))):
        yield f"of its heartbeats {why}"
    states = [state for state in traffic.states.get(node_id, ()) if state is not NmtState.INITIALISING]
    if len(states) > 2 and not traffic.commands and not traffic.boot_ups[node_id]:
        yield f"its heartbeats alternate between {states[0].label} and {states[1].label} without an NMT command"


@check(
    "heartbeat-not-heard",
    ERROR,
    "a node is configured to send a heartbeat, but no heartbeat was received",
    source(0x1017),
)
def heartbeat_not_heard(network: CheckedNetwork) -> NetFound:
    """Heartbeat consumers take the node for lost."""
    traffic = network.traffic
    for node in () if traffic is None else network.nodes:
        wait_ms = _PATIENCE * node.heartbeat_ms
        if traffic is None or node.node_id in traffic.states or node.node_id in traffic.heartbeat_written:
            continue
        if 0 < wait_ms < traffic.seconds * 1000:
            text = f"0x1017 is {node.heartbeat_ms} ms, but no heartbeat was received within {traffic.seconds:.1f} s"
            yield held(node, PRODUCER_HEARTBEAT), text


@check("heard-not-read", ERROR, "a node sends frames, but cannot be read", "ours")
def heard_not_read(network: CheckedNetwork) -> NetFound:
    """The node's PDOs are not checked."""
    for node_id in () if network.traffic is None else sorted(network.traffic.states):
        if network.state.node(node_id) is None:
            yield NetSpot(), f"node {node_id} sends heartbeats, and was not read"


@check("restarts", WARNING, "a node restarted while the bus was listened to", "CiA 301, 7.2.8.3.3: boot-up")
def restarts(network: CheckedNetwork) -> NetFound:
    """Values only in RAM are lost."""
    for node_id, count in () if network.traffic is None else sorted(network.traffic.boot_ups.items()):
        if count:
            yield NetSpot(node_id), f"its boot-up message was received{_often(count)}"


@check("emergency", WARNING, "a node sent an EMCY while the bus was listened to", "CiA 301, 7.2.7")
def emergency(network: CheckedNetwork) -> NetFound:
    """`faults` explains the code."""
    from dvtcli.domain.emergency_codes import emergency_text

    for node_id, codes in () if network.traffic is None else sorted(network.traffic.emergencies.items()):
        for code, count in sorted(codes.items()):
            yield NetSpot(node_id), f"EMCY 0x{code:04X}, {emergency_text(code)}{_often(count)}"


@check("error-frames", WARNING, "error frames were received", "ISO 11898-1: error flags; wiring, termination, bit rate")
def error_frames(network: CheckedNetwork) -> NetFound:
    """Wiring, termination, or a node with another bit rate."""
    if network.traffic is not None and network.traffic.error_frames:
        yield NetSpot(), f"{plural(network.traffic.error_frames, 'error frame')} in {network.traffic.seconds:.1f} s"
