"""Rules about error control: heartbeat producers, consumers and their times, and guarding."""

from __future__ import annotations

from collections import Counter

from dvtcli.domain.lint import ERROR, NOTE, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, held
from dvtcli.domain.network.network_state import NodeState
from dvtcli.domain.objects import CONSUMER_HEARTBEAT, ERROR_BEHAVIOUR, GUARD_TIME, LIFE_TIME_FACTOR, PRODUCER_HEARTBEAT
from dvtcli.domain.standard_objects import source

_CONSUMER = source(0x1016)
_GUARDING = "CiA 301, 7.2.8.3.2"


def _slot(node: NodeState, producer: int) -> int:
    return next((sub for sub, value in node.slots.items() if value >> 16 & 0xFF == producer), 0)


def _beat_ms(network: CheckedNetwork, node_id: int) -> int | None:
    """Heartbeat period of a node in ms; None if the node is not in the network, or unknown."""
    master = network.state.master
    if master is not None and master.node_id == node_id:
        return master.heartbeat_producer_ms
    node = network.state.node(node_id)
    if node is None:
        return None
    return node.heartbeat_ms or (None if node_id in network.state.undescribed else 0)


@check("heartbeat-not-sent", ERROR, "a node waits for a heartbeat that its producer does not send", _CONSUMER)
def heartbeat_not_sent(network: CheckedNetwork) -> NetFound:
    """Monitoring begins with the first heartbeat: the loss of the producer goes unnoticed."""
    for node in network.nodes:
        for producer in node.watched:
            if _beat_ms(network, producer) == 0:
                text = f"it waits for node {producer}, which sends no heartbeat (0x1017 is 0)"
                yield held(node, CONSUMER_HEARTBEAT, _slot(node, producer)), text


@check("heartbeat-of-nobody", WARNING, "a node waits for the heartbeat of a missing node", _CONSUMER)
def heartbeat_of_nobody(network: CheckedNetwork) -> NetFound:
    """Left over from another network, or the node is missing here."""
    master = network.state.master
    for node in network.nodes:
        for producer in node.watched:
            is_master = master is not None and master.node_id == producer
            if network.state.node(producer) is None and not is_master:
                text = f"it waits for node {producer}, which is not in this network"
                yield held(node, CONSUMER_HEARTBEAT, _slot(node, producer)), text


@check("heartbeat-too-short", ERROR, "a heartbeat is late before it is due: the consumer's time is not above the "
       "producer's", _CONSUMER)  # fmt: skip
def heartbeat_too_short(network: CheckedNetwork) -> NetFound:
    """The consumer reports an error between any two heartbeats."""
    for node in network.nodes:
        for producer, time_ms in node.watched.items():
            beat_ms = _beat_ms(network, producer) or 0
            if beat_ms and time_ms <= beat_ms:
                text = f"it waits {time_ms} ms for node {producer}, which sends a heartbeat every {beat_ms} ms"
                yield held(node, CONSUMER_HEARTBEAT, _slot(node, producer)), text


@check(
    "heartbeat-margin",
    WARNING,
    "a single late heartbeat is an error: the consumer time is less than 1.5 times the producer time",
    f"ours; {_CONSUMER} has it above the producer's",
)
def heartbeat_margin(network: CheckedNetwork) -> NetFound:
    """Producers are late by their own cycle and by the bus."""
    for node in network.nodes:
        for producer, time_ms in node.watched.items():
            beat_ms = _beat_ms(network, producer) or 0
            if beat_ms < time_ms < 1.5 * beat_ms:
                text = f"it waits {time_ms} ms for node {producer}: less than 1.5 times its period of {beat_ms} ms"
                yield held(node, CONSUMER_HEARTBEAT, _slot(node, producer)), text


@check("heartbeat-twice", ERROR, "two entries of 0x1016 wait for the same node", _CONSUMER)
def heartbeat_twice(network: CheckedNetwork) -> NetFound:
    """A device refuses the second entry with 0x06040043."""
    for node in network.nodes:
        used = Counter(value >> 16 & 0xFF for value in node.slots.values() if value & 0xFFFF and value >> 16 & 0xFF)
        for producer, times in used.items():
            if times > 1:
                yield held(node, CONSUMER_HEARTBEAT, _slot(node, producer)), f"{times} entries wait for node {producer}"


@check("heartbeat-of-itself", ERROR, "a node waits for its own heartbeat", _CONSUMER)
def heartbeat_of_itself(network: CheckedNetwork) -> NetFound:
    """A node never receives its own heartbeat."""
    for node in network.nodes:
        if node.node_id in node.watched:
            yield held(node, CONSUMER_HEARTBEAT, _slot(node, node.node_id)), "it waits for its own heartbeat"


@check("heartbeat-node-id", ERROR, "an entry of 0x1016 names a node-ID above 127", _CONSUMER)
def heartbeat_node_id(network: CheckedNetwork) -> NetFound:
    """The node-ID does not exist."""
    for node in network.nodes:
        for sub_index, value in node.slots.items():
            if value >> 16 & 0xFF > 127 and value & 0xFFFF:
                yield held(node, CONSUMER_HEARTBEAT, sub_index), f"node-ID {value >> 16 & 0xFF} in 0x{value:08X}"


@check(
    "no-error-control",
    WARNING,
    "a node has neither heartbeat nor node guarding",
    "CiA 301, 7.2.8.3: heartbeat or node guarding is mandatory",
)
def no_error_control(network: CheckedNetwork) -> NetFound:
    """A loss of the node goes unnoticed."""
    for node in network.described:
        if not node.heartbeat_ms and not node.is_guarded:
            yield held(node, PRODUCER_HEARTBEAT), "it has neither heartbeat nor node guarding"


@check("heartbeat-and-guarding", ERROR, "a node sends a heartbeat and is guarded", _GUARDING)
def heartbeat_and_guarding(network: CheckedNetwork) -> NetFound:
    """Heartbeat and guarding use the same CAN-ID and exclude each other."""
    for node in network.nodes:
        if node.heartbeat_ms and node.is_guarded:
            yield held(node, GUARD_TIME), f"0x1017 is {node.heartbeat_ms} ms, and it is guarded"


@check("half-guarding", WARNING, "either guard time or life time factor is 0, but not both", _GUARDING)
def half_guarding(network: CheckedNetwork) -> NetFound:
    """Guarding stays off."""
    for node in network.described:
        time, factor = node.number(GUARD_TIME) or 0, node.number(LIFE_TIME_FACTOR) or 0
        if bool(time) != bool(factor):
            yield held(node, GUARD_TIME), f"0x100C is {time} ms, 0x100D is {factor}"


@check("guarding", NOTE, "a node is guarded, by remote frames", "CiA 301, 7.2.8.3.1: heartbeat is recommended instead")
def guarding(network: CheckedNetwork) -> NetFound:
    """A master has to poll the node all the time."""
    for node in network.nodes:
        if node.is_guarded and not node.heartbeat_ms:
            yield held(node, GUARD_TIME), "it uses node guarding; a heartbeat needs no remote frames"


@check("unwatched-link", WARNING, "the consumer of a PDO does not wait for the heartbeat of its producer", _CONSUMER)
def unwatched_link(network: CheckedNetwork) -> NetFound:
    """The consumer keeps the last values after a loss of the producer, unless the RPDO has a deadline."""
    reported: set[tuple[int, int]] = set()
    for connection in network.received:
        pair = connection.consumer.node_id, connection.producer.node_id
        timed = bool(connection.takes.communication.event_timer)
        if (
            connection.consumer not in network.described
            or pair in reported
            or timed
            or pair[1] in connection.consumer.watched
        ):
            continue
        if connection.producer.heartbeat_ms:
            reported.add(pair)
            yield connection.spot, f"it receives {connection.sender}, but does not monitor its heartbeat"


@check(
    "goes-on-after-error",
    NOTE,
    "a heartbeat consumer does not change its NMT state when a heartbeat is missing (0x1029:01 is 1)",
    source(0x1029),
)
def goes_on_after_error(network: CheckedNetwork) -> NetFound:
    """The node's outputs keep their state."""
    for node in network.nodes:
        if node.watched and node.number(ERROR_BEHAVIOUR, 1) == 1:
            yield held(node, ERROR_BEHAVIOUR, 1), "it stays in its state after a communication error"


@check(
    "deadline-below-period",
    ERROR,
    "the event timer (deadline) of an RPDO is shorter than the period of its TPDO",
    "CiA 301, 7.5.2.35: event timer",
)
def deadline_below_period(network: CheckedNetwork) -> NetFound:
    """The consumer reports an error between any two frames."""
    periods = {(stream.node, stream.pdo): _longest_ms(network, stream.node, stream.pdo)
               for stream in network.streams.streams if stream.kind == "tpdo"}  # fmt: skip
    for connection in network.received:
        patience = connection.takes.communication.event_timer or 0
        period = periods.get((connection.producer.node_id, connection.tpdo))
        if patience and period and patience <= period:
            yield (
                connection.spot,
                f"its deadline is {patience} ms; {connection.sender} is transmitted every {period:g} ms",
            )


def _longest_ms(network: CheckedNetwork, node_id: int | None, pdo: object) -> float | None:
    """Maximum time between two frames of a TPDO, in ms; None if unknown."""
    found = next((tpdo for tpdo in network.tpdos if tpdo[0].node_id == node_id and tpdo[1] == pdo), None)
    if found is None:
        return None
    parameter = found[2].communication
    kind, sync_us = parameter.transmission_type, min(network.state.sync_periods_us, default=None)
    if kind is not None and 1 <= kind <= 240:
        return None if sync_us is None else kind * sync_us / 1000
    return max(parameter.event_timer, (parameter.inhibit_time or 0) / 10) if parameter.event_timer else None


@check(
    "deadline-without-timer",
    WARNING,
    "an RPDO has an event timer (deadline), but its TPDO is transmitted on events only",
    "CiA 301, 7.5.2.35 and 7.5.2.37: event timer",
)
def deadline_without_timer(network: CheckedNetwork) -> NetFound:
    """The consumer reports an error while no value changes."""
    for connection in network.received:
        sends = connection.sends.communication
        by_event = sends.transmission_type in (254, 255) and not sends.event_timer
        if connection.takes.communication.event_timer and by_event:
            yield (
                connection.spot,
                f"its deadline is {connection.takes.communication.event_timer} ms; {connection.sender} has no event "
                f"timer",
            )
