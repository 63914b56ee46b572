"""Rules about layouts: each PDO's own mapping, and equal layouts of producers and consumers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.frame import layout as fields_of
from dvtcli.domain.lint import ERROR, NOTE, WARNING, LintRule, RuleCheck, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, NetSpot, PdoConnection, at
from dvtcli.domain.network.links import LinkSide
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_state import Identifier, identifier_of
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.domain.process_data import commanded_by_other, is_controlword
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import can_id, communication, mapped_object, pdo_mapping
from dvtcli.domain.rules.finding import Rule

_LAYOUT = "CiA 301, 7.5.2.36 and 7.5.2.38: producer and consumer of a PDO have the same layout"
_LENGTHS = "CiA 301, emergency error codes 0x8210 and 0x8220"
_ONE_ID = "CiA 301, 7.3.5: a PDO has one CAN-ID"


@check("rpdo-without-producer", WARNING, "no node transmits the frames of an enabled RPDO", _ONE_ID)
def rpdo_without_producer(network: CheckedNetwork) -> NetFound:
    """A master may send it: silent if the file names a master."""
    if network.state.master is not None:
        return
    for node, pdo, config in network.rpdos:
        if identifier_of(config) not in network.sent:
            yield at(node, pdo), f"no node of the network transmits {config.communication.cob_id}"


@check("tpdo-without-consumer", NOTE, "no node receives an enabled TPDO", _ONE_ID)
def tpdo_without_consumer(network: CheckedNetwork) -> NetFound:
    """A master may receive it: silent if the file names a master."""
    received = {identifier_of(config) for _, _, config in network.rpdos}
    if network.state.master is not None:
        return
    for node, pdo, config in network.tpdos:
        if identifier_of(config) not in received:
            yield at(node, pdo), f"no RPDO of the network receives {config.communication.cob_id}"


@check("own-tpdo", ERROR, "an RPDO waits for a TPDO of its own node", "a CAN node does not receive its own frames")
def own_tpdo(network: CheckedNetwork) -> NetFound:
    """The RPDO receives nothing, or frames that another node sends by mistake."""
    for node, pdo, config in network.rpdos:
        for sent in (other for owner, other, sends in network.tpdos
                     if owner is node and identifier_of(sends) == identifier_of(config)):  # fmt: skip
            yield at(node, pdo), f"{config.communication.cob_id} is sent by {sent.label} of the node itself"


@check("frame-format", ERROR, "an RPDO and its TPDO have CAN-IDs of different lengths (11 and 29 bits)",
       "CiA 301, 7.5.2.35: bit 29 (frame)")  # fmt: skip
def frame_format(network: CheckedNetwork) -> NetFound:
    """The same number is another CAN-ID."""
    for node, pdo, config in network.rpdos:
        can_id, extended = identifier_of(config)
        if (can_id, extended) not in network.sent and (can_id, not extended) in network.sent:
            sent = can_id_text(can_id, extended=not extended)
            yield at(node, pdo), f"it waits for {29 if extended else 11} bits, {sent} is sent with the other format"


@check(
    "heard-twice",
    WARNING,
    "two enabled RPDOs of a node have the same CAN-ID",
    "dvtcli's own: devices serve one of the two RPDOs, or both",
)
def heard_twice(network: CheckedNetwork) -> NetFound:
    """The device decides which RPDO receives the frame."""
    seen: dict[tuple[int, Identifier], Pdo] = {}
    for node, pdo, config in network.rpdos:
        other = seen.setdefault((node.node_id, identifier_of(config)), pdo)
        if other != pdo:
            yield at(node, pdo), f"{other.label} has {config.communication.cob_id}, too"


@check("frame-too-short", ERROR, "a TPDO sends less than an RPDO that receives it maps: the frame is ignored (0x8210)",
       _LENGTHS)  # fmt: skip
def frame_too_short(network: CheckedNetwork) -> NetFound:
    """The consumer sends an EMCY for each."""
    for connection in _whole(network):
        if connection.takes.bits > connection.sends.bits:
            yield (
                connection.spot,
                f"it maps {connection.takes.bits} bits, {connection.sender} sends {connection.sends.bits}",
            )


@check("frame-too-long", WARNING, "a TPDO sends more than an RPDO that receives it maps: the rest is dropped (0x8220)",
       _LENGTHS)  # fmt: skip
def frame_too_long(network: CheckedNetwork) -> NetFound:
    """Devices may send an EMCY for it; dummies show that it is intended."""
    for connection in _whole(network):
        if connection.takes.bits < connection.sends.bits:
            yield (
                connection.spot,
                f"it maps {connection.takes.bits} bits, {connection.sender} sends {connection.sends.bits}",
            )


@check("layout", ERROR, "an object of an RPDO lies across two objects of the TPDO that it receives", _LAYOUT)
def layout(network: CheckedNetwork) -> NetFound:
    """The received value mixes two objects."""
    for connection in _whole(network):
        for received in fields_of(connection.takes.mapping):
            sent = [field.entry for field in fields_of(connection.sends.mapping)
                    if field.start_bit < received.end_bit and received.start_bit < field.end_bit]  # fmt: skip
            if len(sent) > 1 and not received.entry.is_dummy:
                text = (
                    f"{received.entry.object} receives parts of {sent[0].object} and {sent[1].object} "
                    f"of {connection.sender}"
                )
                yield connection.spot, text


@check("part-of-object", WARNING, "an object of an RPDO receives some bits of a longer object", _LAYOUT)
def part_of_object(network: CheckedNetwork) -> NetFound:
    """Intended for bits of a status word, a mistake for numbers."""
    for one, received, sent in _pairs(network):
        if received.bits < sent.bits:
            yield (
                one.spot,
                f"{received.object} receives {received.bits} of the {sent.bits} bits of {sent.object} of {one.sender}",
            )


@check("data-type", WARNING, "an object of an RPDO receives an object of another data type", "both devices' files")
def data_type(network: CheckedNetwork) -> NetFound:
    """-1 becomes 65535, a REAL nonsense."""
    for one, received, sent in _pairs(network):
        producer, consumer = _sides(one)
        types = consumer.type(received), producer.type(sent)
        if received.bits == sent.bits and types[0] is not None and types[1] is not None and types[0] != types[1]:
            names = f"{consumer.name(received)} is {types[0].short}"
            yield one.spot, f"{names} and receives {producer.name(sent)}, {types[1].short}, of {one.sender}"


@check(
    "hears-no-command",
    WARNING,
    "a controlword receives a value that is not a controlword",
    "CiA 402-2, 8.4: it moves the machine",
)
def hears_no_command(network: CheckedNetwork) -> NetFound:
    """One drive's statusword enables another drive."""
    yield from _commanded(network, controlwords=True)


@check(
    "hears-no-target",
    NOTE,
    "a target or an output receives another kind of value (of a link: link-target)",
    "CiA 401-1, CiA 402-2: it moves the machine",
)
def hears_no_target(network: CheckedNetwork) -> NetFound:
    """Intended for a drive that follows another drive, or a lamp that shows a switch."""
    yield from _commanded(network, controlwords=False)


@check("sends-nothing", WARNING, "an enabled TPDO maps nothing", "CiA 301, 7.5.2.38")
def sends_nothing(network: CheckedNetwork) -> NetFound:
    """Its frames carry no data, or are never sent."""
    for node, pdo, config in network.tpdos:
        if not config.mapping and config.mpdo is None and not config.inconsistency:
            yield at(node, pdo), "it is enabled and maps nothing"


@check("takes-nothing", WARNING, "an enabled RPDO has no mapped objects, or dummies only", "CiA 301, 7.5.2.36")
def takes_nothing(network: CheckedNetwork) -> NetFound:
    """The RPDO receives frames without effect."""
    for node, pdo, config in network.rpdos:
        empty = all(entry.is_dummy for entry in config.mapping)
        if empty and config.mpdo is None and not config.inconsistency:
            yield at(node, pdo), "it is enabled and maps nothing" if not config.mapping else "it maps dummies only"


@check("no-whole-pdo", ERROR, "an enabled PDO is incomplete: a part of it cannot be read", "CiA 301, 7.5.2.35 to 38")
def no_whole_pdo(network: CheckedNetwork) -> NetFound:
    """The contents of its frames are unknown."""
    for node, pdo, config in network.enabled:
        if config.inconsistency and node in network.described and pdo not in node.unsaid:
            yield at(node, pdo), config.inconsistency


@check("too-long", ERROR, "an enabled PDO maps more than 64 bits", "CiA 301, 7.5.2.36 and 7.5.2.38")
def pdo_length(network: CheckedNetwork) -> NetFound:
    """The limit of `pdo-length` (of a change, and of `eds check`) and of `too-many-bits` (of a simulated device)."""
    for node, pdo, config in network.enabled:
        if config.bits > 64:
            yield at(node, pdo), f"it maps {config.bits} bits"


@check("one-object-two-writers", NOTE, "two enabled RPDOs of a node write the same object", "ours")
def one_object_two_writers(network: CheckedNetwork) -> NetFound:
    """Whichever comes last counts."""
    writers: dict[tuple[int, int, int], Pdo] = {}
    for node, pdo, config in network.rpdos:
        for entry in config.mapping:
            other = writers.setdefault((node.node_id, entry.index, entry.sub_index), pdo)
            if other != pdo and not entry.is_dummy:
                yield at(node, pdo), f"{entry.object} is written by {other.label}, too"


@check("synchronous-consumer", NOTE, "a synchronous RPDO receives an event-driven TPDO",
       "CiA 301, 7.5.2.35: transmission type")  # fmt: skip
def synchronous_consumer(network: CheckedNetwork) -> NetFound:
    """Values act only at the next SYNC, and earlier frames before that SYNC are lost."""
    for connection in network.received:
        takes, sends = (
            connection.takes.communication.transmission_type,
            connection.sends.communication.transmission_type,
        )
        if takes is not None and sends is not None and takes <= 240 and sends >= 254:
            yield (
                connection.spot,
                f"it applies values at SYNC (type {takes}), but {connection.sender} is transmitted on events (type "
                f"{sends})",
            )


def _commanded(network: CheckedNetwork, *, controlwords: bool) -> NetFound:
    """Objects other than commands that feed a controlword, else a setpoint or an output."""
    for one, received, sent in _pairs(network):
        producer, consumer = _sides(one)
        known = consumer.described(received), producer.described(sent)
        if is_controlword(received.index) is controlwords and commanded_by_other(
            received.index, known[0], sent.index, known[1]
        ):
            yield one.spot, f"{consumer.name(received)} receives {producer.name(sent)} of {one.sender}"


def _sides(one: PdoConnection) -> tuple[LinkSide, LinkSide]:
    """Producer and consumer of *one*."""
    sender, hearer = one.producer, one.consumer
    return (
        LinkSide(Endpoint(sender.node_id, one.tpdo), one.sends, sender.profile, sender.dictionary),
        LinkSide(Endpoint(hearer.node_id, one.rpdo), one.takes, hearer.profile, hearer.dictionary),
    )


def _whole(network: CheckedNetwork) -> Iterator[PdoConnection]:
    """Connections with known mappings on both sides."""
    for connection in network.received:
        odd = any(
            side.inconsistency or side.mpdo is not None or not side.mapping
            for side in (connection.takes, connection.sends)
        )
        is_resolved = (
            connection.rpdo not in connection.consumer.unresolved
            and connection.tpdo not in connection.producer.unresolved
        )
        if is_resolved and not odd:
            yield connection


def _pairs(network: CheckedNetwork) -> Iterator[tuple[PdoConnection, PdoMappingEntry, PdoMappingEntry]]:
    """Each received object with the sent object around it."""
    for connection in _whole(network):
        for received in (field for field in fields_of(connection.takes.mapping) if not field.entry.is_dummy):
            for sent in fields_of(connection.sends.mapping):
                if sent.start_bit <= received.start_bit and received.end_bit <= sent.end_bit:
                    yield connection, received.entry, sent.entry


_PLACE = re.compile(r"0x([0-9A-F]{4}):([0-9A-F]{2})")
_DECLARED: dict[str, Rule] = {
    rule.name: rule for file in (can_id, communication, pdo_mapping, mapped_object) for rule in file.RULES
}


def _judged(name: str, severity: Severity, sense: str, of: str = "") -> RuleCheck[CheckedNetwork, NetSpot]:
    """A check that reports the `map` rule *of* (default: the same name), at the same severity."""
    rule = LintRule(name, severity, f"an enabled PDO {sense}", _DECLARED[of or name].source)
    return RuleCheck(rule, partial(_look, of or name, severity))


def _look(name: str, severity: Severity, network: CheckedNetwork) -> NetFound:
    for node_id, pdo, finding in network.judged:
        if finding.rule == name and finding.severity is severity:
            place = _PLACE.fullmatch(finding.place)
            index, sub_index = (int(place[1], 16), int(place[2], 16)) if place else (None, 0)
            yield NetSpot(node_id, pdo, index, sub_index), finding.text


#: The other rules judge a requested change, or have a network rule of their own.
OF_EACH_PDO = (
    _judged("object-exists", ERROR, "maps an object that the device does not have"),
    _judged("direction", ERROR, "sends an unreadable object, or receives a read-only object"),
    _judged("mappable", ERROR, "maps an object with PDOMapping=0"),
    _judged("read-write-object", WARNING, "sends an object for RPDOs (rww)"),
    _judged("object-for-rpdos", ERROR, "sends an object for RPDOs (rww) on a device that refuses it",
            "read-write-object"),
    _judged("entry-length", ERROR, "maps a length other than the object's, 0 bits, or more than 64 bits"),
    _judged("granularity", ERROR, "maps a length that is not a multiple of Granularity"),
    _judged("dummy-direction", ERROR, "is a TPDO and skips bits"),
    _judged("dummy-supported", ERROR, "skips bits with a dummy that the device does not have"),
    _judged("dummy-length", ERROR, "maps a dummy with a length other than its type's"),
    _judged("double-target", ERROR, "is an RPDO and maps an object twice"),
    _judged("can-id-length", ERROR, "has a CAN-ID of more than 11 bits without bit 29 (frame)"),
    _judged("extended-id", ERROR, "has a CAN-ID of 29 bits on a device that accepts 11"),
    _judged("rtr-bit", ERROR, "has the wrong bit 30 for its family"),
)  # fmt: skip
