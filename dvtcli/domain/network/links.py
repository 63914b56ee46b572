"""Links: map an RPDO for a TPDO, choose its CAN-ID, and watch the producer's heartbeat."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import DataType
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.network_config import Endpoint, LinkConfig
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.pdo import DUMMY_BITS, MAX_PDO_BITS, Pdo, PdoConfig, PdoMappingEntry, split_dummy, total_bits
from dvtcli.domain.process_data import commanded_by_other, is_controlword
from dvtcli.domain.profile import DeviceProfile, Severity
from dvtcli.domain.rules.can_id import FREE_POOL, restricted_use
from dvtcli.domain.rules.finding import ERROR, NOTE, WARNING, Finding, Proposal, Rule, error, note, warning
from dvtcli.domain.rules.mapped_object import is_taken, object_findings
from dvtcli.domain.rules.pdo_mapping import known_dummies
from dvtcli.domain.standard_objects import source
from dvtcli.domain.text import join_some

#: Default CAN-IDs of SYNC, EMCY and TIME, which CiA 301 does not restrict.
_SERVICES = range(0x080, 0x101)
#: CAN-IDs of PDOs in the pre-defined connection set (CiA 301, 7.3.5).
_PREDEFINED = range(0x181, 0x580)


def may_keep(cob_id: CobId, used: Collection[int]) -> bool:
    """Whether a TPDO may use the CAN-ID of *cob_id* while others use *used*."""
    if not cob_id.fits_frame or cob_id.can_id in used:
        return False
    return cob_id.extended or not (restricted_use(cob_id.can_id) or cob_id.can_id in _SERVICES)


def free_can_id(producer: Endpoint, used: Collection[int]) -> int | None:
    """An unused CAN-ID for *producer*: its default in the pre-defined set, else the next free CAN-ID.

    None if all are in use. 0x680…0x6DF come before the defaults of other PDOs.
    """
    default = producer.pdo.default_can_id(producer.node_id)
    candidates = chain(() if default is None else (default,), FREE_POOL, _PREDEFINED)
    return next((can_id for can_id in candidates if may_keep(CobId(can_id), used)), None)


Configs = Mapping[int, Mapping[Pdo, PdoConfig]]


class FoundLinks(NamedTuple):
    """The *links* found, and RPDOs whose layout is *unlike* the TPDO's: consumer and producer."""

    links: tuple[LinkConfig, ...]
    unlike: tuple[tuple[Endpoint, Endpoint], ...] = ()


def found_links(held: Configs, watches: Callable[[int, int], bool]) -> FoundLinks:
    """Links between nodes with configurations *held*, by node-ID: same CAN-ID, both enabled, matching layouts.

    *watches* tells whether a consumer (first argument) monitors a producer's heartbeat; otherwise the link has no
    heartbeat. A CAN-ID sent by several nodes makes no link.
    """
    consumers: dict[Endpoint, list[Endpoint]] = {}
    unlike: list[tuple[Endpoint, Endpoint]] = []
    for consumer, received in _enabled(held, is_tpdo=False):
        senders = [(one, sent) for one, sent in _enabled(held, is_tpdo=True) if _same_id(sent, received)]
        if len(senders) != 1 or senders[0][0].node_id == consumer.node_id:
            continue
        producer, sent = senders[0]
        if agrees(sent.mapping, received.mapping):
            consumers.setdefault(producer, []).append(consumer)
        else:
            unlike.append((consumer, producer))
    links = []
    for producer, ends in sorted(consumers.items(), key=lambda item: (item[0].node_id, item[0].pdo)):
        all_watch = all(watches(end.node_id, producer.node_id) for end in ends)
        links.append(LinkConfig(producer, tuple(ends), None if all_watch else False))
    return FoundLinks(tuple(links), tuple(unlike))


def _enabled(held: Configs, *, is_tpdo: bool) -> Iterator[tuple[Endpoint, PdoConfig]]:
    for node_id, pdos in held.items():
        for pdo, config in pdos.items():
            if pdo.is_tpdo is is_tpdo and config.enabled and config.mpdo is None and not config.inconsistency:
                yield Endpoint(node_id, pdo), config


def _same_id(one: PdoConfig, other: PdoConfig) -> bool:
    a, b = one.communication.cob_id, other.communication.cob_id
    return (a.can_id, a.extended) == (b.can_id, b.extended)


_LAYOUT = "CiA 301, 7.5.2.36 and 7.5.2.38: producer and consumer of a PDO have the same layout"
RULES = (
    Rule("link-self", ERROR, "an RPDO is linked to a TPDO of its own node", "ours"),
    Rule("link-producer", ERROR, "the TPDO of a link maps nothing, is multiplexed, or incomplete", _LAYOUT),
    Rule("link-consumer", ERROR, "the RPDO of a link maps no object, is multiplexed, or incomplete", _LAYOUT),
    Rule("link-length", ERROR, "nothing that the TPDO of a link sends is as long as an object of its RPDO", _LAYOUT),
    Rule("link-place", ERROR, "an object of a link's RPDO could receive several of the TPDO's", "ours"),
    Rule("link-skip", ERROR, "the consumer of a link has no dummies for the other bits", _LAYOUT),
    Rule("link-type", WARNING, "an object receives an object of another data type", "both devices' files"),
    Rule("link-part", WARNING, "an object receives some bits of a longer object", "ours"),
    Rule("link-command", WARNING, "a controlword receives a value that is not a controlword",
         "CiA 402-2, 8.4: it moves the machine"),
    Rule("link-target", NOTE, "a target or an output receives another kind of value (of a network: hears-no-target)",
         "CiA 401-1, CiA 402-2"),
    Rule("link-object", WARNING, "a PDO of a link maps an object that its file excludes", "both devices' files"),
    Rule("link-guarded", ERROR, "a heartbeat is to be sent by a node that is guarded (0x100C x 0x100D is not 0)",
         "CiA 301, 7.2.8.3.2: node guarding and heartbeat exclude each other"),
    Rule("link-no-heartbeat", ERROR, "a heartbeat is to be set on a node that has no 0x1017", source(0x1017)),
    Rule("link-silent", NOTE, "the producer of a link sends no heartbeat, so that no node notices its loss",
         source(0x1017)),
    Rule("link-unwatched", WARNING, "the consumer of a link cannot watch the producer's heartbeat",
         source(0x1016)),
)  # fmt: skip
#: Rules whose findings are asked about before execution, in interactive use.
MOVES = frozenset({"link-command", "link-target"})


@dataclass(frozen=True, slots=True)
class LinkSide:
    """An end of a link: the PDO's final configuration, and the device's profile and dictionary."""

    end: Endpoint
    config: PdoConfig
    profile: DeviceProfile
    dictionary: ObjectDictionary | None = None

    def __str__(self) -> str:
        return f"{self.end.node_id}:{self.end.pdo}"

    def name(self, entry: PdoMappingEntry) -> str:
        """The object with its name if known: `6041:00 "Statusword"`."""
        known = self.dictionary.display_name(entry.index, entry.sub_index) if self.dictionary else ""
        return f'{entry.object} "{known}"' if known else entry.object

    def type(self, entry: PdoMappingEntry) -> DataType | None:
        """The entry's data type, None if no file gives it."""
        described = self.described(entry)
        return None if described is None else described.data_type

    def described(self, entry: PdoMappingEntry) -> OdEntry | None:
        """The entry's description in the device's file, None without description."""
        return self.dictionary.entry(entry.index, entry.sub_index) if self.dictionary else None


class Linked(NamedTuple):
    """Mapping for the consumer, and findings; empty if an error is among *findings*."""

    mapping: tuple[PdoMappingEntry, ...]
    findings: tuple[Finding, ...] = ()


def linked(producer: LinkSide, consumer: LinkSide) -> Linked:
    """The mapping with which *consumer* receives *producer*.

    A mapping stays if it has the producer's length and no object spans two of the producer's. Otherwise each object
    gets the only place with its length and type, in frame order if ambiguous; dummies skip the rest.
    """
    refused = tuple(_refused(producer, consumer))
    if refused:
        return Linked((), refused)
    wanted = consumer.config.mapping
    if not agrees(producer.config.mapping, wanted):
        wanted, refused = _placed(producer, consumer)
    return Linked(wanted, refused or tuple(_remarks(producer, consumer, wanted)))


def agrees(sent: Sequence[PdoMappingEntry], received: Sequence[PdoMappingEntry]) -> bool:
    """Whether an RPDO with mapping *received* fits *sent*: same length, no object across two sent objects."""
    if not sent or total_bits(sent) != total_bits(received):
        return False
    return all(_over(sent, start, entry.bits) is not None for start, entry in _starts(received) if not entry.is_dummy)


def object_remarks(side: LinkSide) -> Iterator[Finding]:
    """Errors in the device's file about objects that *side* maps already: the rules judge only changes."""
    config = side.config
    proposal = Proposal(
        node_id=side.end.node_id,
        pdo=side.end.pdo,
        now=config,
        want=config,
        others={},
        profile=side.profile,
        dictionary=side.dictionary,
    )
    for number, entry in enumerate(config.mapping, 1):
        place = proposal.mapping_place(number)
        found = () if entry.is_dummy else object_findings(proposal, place, entry)
        for finding in found:
            if finding.severity is Severity.ERROR:
                yield warning("link-object", str(side), f"{side} maps what it cannot: {finding.text}")


def _starts(mapping: Sequence[PdoMappingEntry]) -> Iterator[tuple[int, PdoMappingEntry]]:
    """Each entry with its first bit in the frame."""
    start = 0
    for entry in mapping:
        yield start, entry
        start += entry.bits


def _over(sent: Sequence[PdoMappingEntry], start: int, bits: int) -> PdoMappingEntry | None:
    """The entry of *sent* that contains all *bits* from *start* on."""
    spans = ((first, entry) for first, entry in _starts(sent))
    return next((one for first, one in spans if first <= start and start + bits <= first + one.bits), None)


def _refused(producer: LinkSide, consumer: LinkSide) -> Iterator[Finding]:
    if producer.end.node_id == consumer.end.node_id:
        yield error("link-self", str(consumer), f"{consumer} cannot receive {producer}: both are PDOs of one node")
    if wrong := _not_whole(producer.config) or ("" if producer.config.mapping else "maps nothing"):
        yield error(
            "link-producer", str(producer), f"{producer} {wrong}", hint=Hint(Action.MAP, {"pdo": producer}, "{} first")
        )
    objects = any(not entry.is_dummy for entry in consumer.config.mapping)
    nothing = "maps dummies only" if consumer.config.mapping else "maps nothing"
    if wrong := _not_whole(consumer.config) or ("" if objects else nothing):
        hint = _other_objects(producer, consumer, "first")
        yield error("link-consumer", str(consumer), f"{consumer} {wrong}", hint=hint)


def _not_whole(config: PdoConfig) -> str:
    if config.mpdo is not None:
        return "is a multiplexed PDO"
    if config.inconsistency:
        return f"is incomplete: {config.inconsistency}"
    return f"is {config.bits} bits long, a PDO holds {MAX_PDO_BITS}" if config.bits > MAX_PDO_BITS else ""


def _placed(producer: LinkSide, consumer: LinkSide) -> tuple[tuple[PdoMappingEntry, ...], tuple[Finding, ...]]:
    """The consumer's objects at the producer's places with dummies between, or the reason against it."""
    sent = producer.config.mapping
    objects = [entry for entry in consumer.config.mapping if not entry.is_dummy]

    def alike(wanted: int, offered: int) -> bool:
        return _is_alike(producer, sent[offered], consumer, objects[wanted])

    def long(wanted: int, offered: int) -> bool:
        return sent[offered].bits == objects[wanted].bits

    for fits in (alike, long):
        places = _places(len(objects), len(sent), fits)
        if places is not None:
            break
    else:
        return (), (_no_place(producer, consumer, objects),)
    first, last = places
    if first != last:
        return (), (_ambiguous(producer, consumer, objects, first, last),)
    return placed_mapping(producer, consumer, dict(zip(first, objects, strict=True)))


def _is_alike(producer: LinkSide, sent: PdoMappingEntry, consumer: LinkSide, received: PdoMappingEntry) -> bool:
    """Whether both have the same length and, if known, the same type."""
    types = producer.type(sent), consumer.type(received)
    return sent.bits == received.bits and (None in types or types[0] == types[1])


def _places(
    wanted: int, offered: int, fits: Callable[[int, int], bool]
) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """First and last possible assignment of *wanted* objects to places among *offered*; None if impossible.

    In frame order if possible, else each object at the only place that fits. A unique assignment is returned twice.
    """
    first = _in_order(range(wanted), range(offered), fits)
    last = _in_order(range(wanted)[::-1], range(offered)[::-1], fits)
    if first is not None and last is not None:
        return first, last[::-1]
    choices = [[place for place in range(offered) if fits(number, place)] for number in range(wanted)]
    only = tuple(choice[0] for choice in choices if len(choice) == 1)
    return (only, only) if len(set(only)) == wanted else None


def _in_order(wanted: range, offered: range, fits: Callable[[int, int], bool]) -> tuple[int, ...] | None:
    """The earliest places in *offered* order that fit the *wanted* objects one after the other."""
    found: list[int] = []
    places = iter(offered)
    for number in wanted:
        place = next((place for place in places if fits(number, place)), None)
        if place is None:
            return None
        found.append(place)
    return tuple(found)


def _no_place(producer: LinkSide, consumer: LinkSide, objects: list[PdoMappingEntry]) -> Finding:
    lengths = {entry.bits for entry in producer.config.mapping}
    odd = next((entry for entry in objects if entry.bits not in lengths), None)
    layout = join_some(f"{entry.object}/{entry.bits}" for entry in producer.config.mapping)
    what = f"{consumer.name(odd)}, {odd.bits} bits," if odd else f"not all {len(objects)} objects of {consumer}"
    verb = "has no place" if odd else "have a place"
    hint = Hint(Action.MAP, {"pdo": consumer, "off": True}, "{} with objects of these lengths")
    return error("link-length", str(consumer), f"{what} {verb} in {producer}, which sends {layout}", hint=hint)


def _ambiguous(
    producer: LinkSide,
    consumer: LinkSide,
    objects: Sequence[PdoMappingEntry],
    first: Sequence[int],
    last: Sequence[int],
) -> Finding:
    """Refuse to choose between the places *first* and *last* of *objects*; the hint has a mapping for each."""
    number = next(number for number, pair in enumerate(zip(first, last, strict=True)) if pair[0] != pair[1])
    sent, starts = producer.config.mapping, [start for start, _ in _starts(producer.config.mapping)]
    names = [producer.name(sent[places[number]]) for places in (first, last)]
    if names[0] == names[1]:
        names = [f"{name} at bit {starts[places[number]]}" for name, places in zip(names, (first, last), strict=True)]
    text = f"{consumer.name(objects[number])} of {consumer} could receive {names[0]} or {names[1]}"
    choices = [
        (name, placed)
        for name, places in zip(names, (first, last), strict=True)
        if not _moves_drive(producer, consumer, placed := dict(zip(places, objects, strict=True)))
    ]
    made = [(name, *placed_mapping(producer, consumer, placed)) for name, placed in choices]
    hints = [
        _map_hint(consumer, mapping, f"{{}} receives {verbatim(name)}")
        for name, mapping, refused in made
        if not refused
    ]
    if hints:
        hint = sum(hints[1:], start=hints[0])
    else:
        hint = _shorter(producer, consumer, choices[0][1] if choices else dict(zip(first, objects, strict=True)))
    return error("link-place", str(consumer), text, hint=hint)


def _map_hint(side: LinkSide, mapping: Sequence[PdoMappingEntry], why: str) -> Hint:
    """The hint to map *mapping* to the PDO of *side*; an RPDO stays off, for a link to enable it."""
    words = tuple(f"dummy/{entry.bits}" if entry.is_dummy else str(entry) for entry in mapping)
    return Hint(Action.MAP, {"pdo": side, "objects": words, "off": not side.end.pdo.is_tpdo}, why)


def _shorter(producer: LinkSide, consumer: LinkSide, placed: Mapping[int, PdoMappingEntry]) -> Hint:
    """The hint for a consumer that cannot skip: its producer sends only the entries that *placed* has, by number."""
    if _moves_drive(producer, consumer, placed):
        return _other_objects(producer, consumer, f"a controlword moves the drive, and {producer} sends none: first")
    sent = [producer.config.mapping[number] for number in sorted(placed)]
    why = f"{consumer} has no dummies for what it does not take: let {producer} send only what it takes, {{}}"
    return _map_hint(producer, sent, why)


def _other_objects(producer: LinkSide, consumer: LinkSide, first: str) -> Hint:
    """The hint to map other objects to *consumer*, after the words *first*."""
    sent = join_some(f"{entry.object} ({entry.bits} bits)" for entry in producer.config.mapping)
    why = f"{first} {{}}, with what should receive {sent} of {producer}; then link"
    return Hint(Action.MAP, {"pdo": consumer, "off": True}, why)


def _moves_drive(producer: LinkSide, consumer: LinkSide, placed: Mapping[int, PdoMappingEntry]) -> bool:
    """Whether a controlword among the objects *placed* receives a value that is no command."""
    sent = producer.config.mapping
    return any(_drives(producer, sent[number], consumer, received) for number, received in placed.items())


def _drives(producer: LinkSide, sent: PdoMappingEntry, consumer: LinkSide, received: PdoMappingEntry) -> bool:
    """Whether the controlword *received* gets *sent*, which is no command."""
    return is_controlword(received.index) and _is_commanded(producer, sent, consumer, received)


def _is_commanded(producer: LinkSide, sent: PdoMappingEntry, consumer: LinkSide, received: PdoMappingEntry) -> bool:
    """Whether the command, setpoint or output *received* gets *sent*, which is none."""
    return commanded_by_other(received.index, consumer.described(received), sent.index, producer.described(sent))


def receivers(producer: LinkSide, sent: PdoMappingEntry, consumer: LinkSide) -> list[PdoMappingEntry]:
    """The objects of *consumer* that can receive *sent* of *producer*: the same index first, then the same type.

    A controlword comes last for a value that is no command.
    """
    dictionary = consumer.dictionary
    entries = () if dictionary is None else dictionary.entries()
    fit = [
        PdoMappingEntry(entry.index, entry.sub_index, sent.bits)
        for entry in entries
        if dictionary is not None and entry.bits == sent.bits
        and is_taken(consumer.profile, dictionary, entry, tpdo=False)
    ]  # fmt: skip
    return sorted(
        fit,
        key=lambda entry: (
            _drives(producer, sent, consumer, entry),
            entry.index != sent.index,
            not _is_alike(producer, sent, consumer, entry),
        ),
    )


def placed_mapping(
    producer: LinkSide, consumer: LinkSide, placed: Mapping[int, PdoMappingEntry]
) -> tuple[tuple[PdoMappingEntry, ...], tuple[Finding, ...]]:
    """The mapping of objects *placed* at the producer's entries, by number, with dummies for the other entries."""
    usable = known_dummies(consumer.dictionary, consumer.profile)
    mapping: list[PdoMappingEntry] = []
    skipped = 0
    try:
        for number, sent in enumerate(producer.config.mapping):
            if number not in placed:
                skipped += sent.bits
                continue
            mapping += [*split_dummy(skipped, DUMMY_BITS if usable is None else usable), placed[number]]
            skipped = 0
        mapping += split_dummy(skipped, DUMMY_BITS if usable is None else usable)
    except ValueError as wrong:
        hint = _shorter(producer, consumer, placed)
        if not _moves_drive(producer, consumer, placed):
            hint += ", or map the rest onto objects that nobody uses"
        return (), (error("link-skip", str(consumer), f"{consumer} cannot receive {producer}: {wrong}", hint=hint),)
    return tuple(mapping), ()


def _remarks(producer: LinkSide, consumer: LinkSide, mapping: Sequence[PdoMappingEntry]) -> Iterator[Finding]:
    """Warnings for objects that receive another type or a part of an object, and for commands fed by other values."""
    for start, received in _starts(mapping):
        sent = None if received.is_dummy else _over(producer.config.mapping, start, received.bits)
        if sent is None:
            continue
        yield from _command_remarks(producer, sent, consumer, received)
        if sent.bits != received.bits:
            text = f"receives {received.bits} of the {sent.bits} bits of {producer.name(sent)}"
            yield warning("link-part", str(consumer), f"{consumer.name(received)} of {consumer} {text}")
        elif not _is_alike(producer, sent, consumer, received):
            types = [
                data_type.short if data_type else "?" for data_type in (consumer.type(received), producer.type(sent))
            ]
            text = (
                f"{consumer.name(received)} of {consumer} is {types[0]} and receives {producer.name(sent)}, {types[1]}"
            )
            yield warning("link-type", str(consumer), text)


def _command_remarks(
    producer: LinkSide, sent: PdoMappingEntry, consumer: LinkSide, received: PdoMappingEntry
) -> Iterator[Finding]:
    """A warning if an object other than a command feeds a command, a setpoint or an output."""
    if _is_commanded(producer, sent, consumer, received):
        text = f"{producer.name(sent)} of {producer} goes to {consumer.name(received)} of {consumer}"
        if is_controlword(received.index):
            yield warning(
                "link-command",
                str(consumer),
                text,
                hint="a controlword moves the drive",
            )
        else:
            yield note("link-target", str(consumer), text)


#: Consumer time in heartbeat periods: the default of `heartbeat_multiplier` in a network file.
CONSUMER_PERIODS = 3
LONGEST_MS = 0xFFFF


def watch_time_ms(producer_ms: int, multiplier: float = CONSUMER_PERIODS) -> int | None:
    """Consumer time in ms for a heartbeat sent every *producer_ms* (1..65535); None if no longer time is possible.

    The time is *multiplier* (1 and up) times the producer's.
    """
    time_ms = min(int(multiplier * producer_ms), LONGEST_MS)
    return time_ms if time_ms > producer_ms else None


def watched_ms(slots: Mapping[int, int], producer: int) -> int:
    """Consumer time in ms of the entries of 0x1016 in *slots*, by sub-index, for node *producer*; 0 for none.

    Source: CiA 301, 7.5.2.19: node-ID in bits 16..23, time in ms below.
    """
    return next((value & 0xFFFF for value in slots.values() if value >> 16 & 0xFF == producer and value & 0xFFFF), 0)


def slot_for(slots: Mapping[int, int], producer: int) -> int | None:
    """The sub-index of 0x1016 that watches node *producer*, else a free sub-index, else None.

    An entry is free if its node-ID or its time is 0 (CiA 301, 7.5.2.19).
    """
    used = {sub_index: value for sub_index, value in slots.items() if value & 0xFFFF and value >> 16 & 0xFF}
    own = (sub_index for sub_index, value in used.items() if value >> 16 & 0xFF == producer)
    return next(own, next((sub_index for sub_index in slots if sub_index not in used), None))
