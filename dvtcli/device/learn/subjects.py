"""Choose the PDOs of a node to probe, and the values to probe with. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.other_producers import producers
from dvtcli.device.read_pdos import ABSENT, service_ids
from dvtcli.domain.abort import Abort
from dvtcli.domain.datatypes import Kind
from dvtcli.domain.learning.probe import Features, ProbedPdo
from dvtcli.domain.learning.probe_table import OTHER_WAY
from dvtcli.domain.learning.read_dictionary import TO_READ, Absence, ReadDevice, listed
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.objects import IDENTITY, PRODUCER_HEARTBEAT
from dvtcli.domain.pdo import DUMMY_BITS, MAX_ENTRIES, Direction, Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.rules import Proposal
from dvtcli.domain.rules.can_id import FREE_POOL
from dvtcli.domain.rules.communication import leave_a_choice
from dvtcli.domain.rules.mapped_object import FEEDS_TPDO, TAKES_RPDO
from dvtcli.domain.rules.no_way_back import way_back
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.learning.probe_table import KnownAnswers

#: How many objects of one length are tried until the device maps one.
_TRIES = 3
_LENGTHS = (1, 8, 16, 32, 64)
#: Sub-indices of a communication parameter that are asked; 4 is reserved, and 6 of a TPDO only (CiA 301, 7.5.2.37).
_PARAMETERS = (2, 3, 5)
_SYNC_START = 6
#: What is asked of a device without a file as an object that is not mappable: its vendor-ID, and its heartbeat's time,
#: whose access is for this direction (CiA 301, 7.5.2.20 and 7.5.2.21).
_STANDARD_UNMAPPABLE = {
    Direction.TPDO: PdoMappingEntry(IDENTITY, 1, 32),
    Direction.RPDO: PdoMappingEntry(PRODUCER_HEARTBEAT, 0, 16),
}


def subjects(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], received: frozenset[int]) -> list[ProbedPdo]:
    """The PDO to probe in each direction: the last disabled PDO, if there is any.

    *pdos* are the node's PDOs, *received* the received CAN-IDs. A direction without a restorable PDO is left out.
    """
    spare = _spare(node, pdos, received)
    found = (_subject(node, pdos, direction, spare) for direction in (Direction.TPDO, Direction.RPDO))
    return [subject for subject in found if subject is not None]


def mapped_subjects(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], first: Sequence[ProbedPdo]) -> list[ProbedPdo]:
    """A mapped substitute for each of *first* with an empty mapping, in case entries of 0 cannot be restored."""
    found: list[ProbedPdo] = []
    for subject in first:
        way = subject.pdo.direction
        mapped = {pdo: held for pdo, held in pdos.items() if held.count} if not subject.held.count else {}
        instead = _subject(node, mapped, way, subject.spare) if mapped else None
        if instead is not None:
            found.append(replace(instead, fits=tuple(_fits(node, pdos, way)), other_way=subject.other_way))
    return found


def _spare(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], received: frozenset[int]) -> tuple[int, ...]:
    """Two CAN-IDs not used by a PDO of a known node, a service, or a received frame."""
    used = {config.communication.cob_id.can_id for config in pdos.values()}
    used |= {producer.cob_id.can_id for producer in producers(node.neighbours())}
    used |= {can_id for can_id, _ in service_ids(node.read_cache, node.node_id, node.dictionary)} | received
    free = [can_id for can_id in FREE_POOL if can_id not in used]
    return tuple(free[-2:]) if len(free) > 1 else ()


def _subject(
    node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], direction: Direction, spare: tuple[int, ...]
) -> ProbedPdo | None:
    for pdo, held in _candidates(pdos, direction):
        if held.mpdo is None and node.is_dynamic(pdo) and _goes_back(node, pdo, held):
            subject = _read(node, pdos, pdo, held, spare)
            if subject.entries:
                return subject
    return None


def _candidates(pdos: Mapping[Pdo, PdoConfig], direction: Direction) -> list[tuple[Pdo, PdoConfig]]:
    """Disabled PDOs first, of these empty PDOs first; among equals the highest number."""
    own = [(pdo, config) for pdo, config in pdos.items() if pdo.direction is direction]
    return sorted(own, key=lambda candidate: (candidate[1].enabled, candidate[1].count > 0, -candidate[0].number))


def _goes_back(node: NodeDescription, pdo: Pdo, held: PdoConfig) -> bool:
    """True if by the rules the device could not refuse the roll-back of the PDO."""
    entry = node.dictionary.entry(pdo.communication_index, 1) if node.dictionary else None
    if entry is not None and not entry.access.writable:
        return False
    if held.inconsistency or (held.enabled and not held.count):
        return False
    opened = PdoConfig(held.disabled().communication, ())
    return (
        way_back(
            Proposal(
                node_id=node.node_id,
                pdo=pdo,
                now=opened,
                want=held,
                others={},
                profile=node.profile,
                dictionary=node.dictionary,
            )
        )
        is None
    )


def _read(
    node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], pdo: Pdo, held: PdoConfig, spare: tuple[int, ...]
) -> ProbedPdo:
    index = pdo.communication_index
    asked = (*_PARAMETERS, _SYNC_START) if pdo.is_tpdo else _PARAMETERS
    parameters = {sub: data for sub in asked if (data := _held(node, index, sub)) is not None}
    entries: list[int] = []
    for number in range(1, MAX_ENTRIES + 1):
        data = _held(node, pdo.mapping_index, number)
        if data is None:
            break
        entries.append(int.from_bytes(data, "little"))
    fits = tuple(_fits(node, pdos, pdo.direction))
    described = node.dictionary
    by_access = {} if described is None else _by_access(described)
    unmappable = (_STANDARD_UNMAPPABLE[pdo.direction],) if described is None else _unmappable(described, pdo)
    objects = {*fits, *(entry for some in by_access.values() for entry in some), *unmappable}
    return ProbedPdo(
        pdo=pdo,
        held=held,
        parameters=parameters,
        entries=tuple(entries),
        fits=fits,
        by_access=by_access,
        unmappable=unmappable,
        features={} if described is None else _features(described, objects),
        absent=_absent(node),
        spare=spare,
        other_way=_other_way(node, pdos, pdo.direction) if described is None else None,
        limits={} if described is None else _limits(described, pdo, node.node_id),
    )


def _other_way(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], direction: Direction) -> PdoMappingEntry | None:
    """The first object mapped only by PDOs of the other direction."""
    mapped = {
        way: [entry for pdo, config in pdos.items() if pdo.direction is way for entry in config.mapping]
        for way in Direction
    }
    own = {(entry.index, entry.sub_index) for entry in mapped.pop(direction)}
    for entry in (entry for entries in mapped.values() for entry in entries):
        place = entry.index, entry.sub_index
        if not entry.is_dummy and place not in own and node.length_of(*place) == entry.bits:
            return entry
    return None


def _limits(dictionary: ObjectDictionary, pdo: Pdo, node_id: int) -> dict[tuple[int, int], tuple[int, int]]:
    """The file's limits for the parameters of *pdo*, if they leave a choice."""
    found = {}
    for index in {pdo.communication_index, pdo.mapping_index} & set(dictionary):
        for entry in dictionary[index].entries.values():
            low, high = entry.limits(node_id)
            least, most = (entry.data_type and entry.data_type.limits) or (0, 0)
            if (low, high) != (None, None) and leave_a_choice(entry, low, high):
                lowest, highest = least if low is None else low, most if high is None else high
                found[index, entry.sub_index] = int(lowest), int(highest)
    return found


def _held(node: ReadableNode, index: int, sub_index: int) -> bytes | None:
    try:
        return node.read_cache.upload(index, sub_index)
    except SdoAborted as aborted:
        if aborted.code in ABSENT:
            return None
        raise


def _fits(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], direction: Direction) -> Iterator[PdoMappingEntry]:
    """Objects to map, the shortest first: those mapped in this direction, followed by those in its file."""
    mapped = [
        entry
        for pdo, config in pdos.items()
        if pdo.direction is direction
        for entry in config.mapping
        if entry.index not in DUMMY_BITS and node.length_of(entry.index, entry.sub_index) == entry.bits
    ]
    named = [] if node.dictionary is None else list(_mappable(node.dictionary, direction))
    for bits in _LENGTHS:
        found = list(dict.fromkeys(entry for entry in (*mapped, *named) if entry.bits == bits))
        yield from _varied(node, found)[:_TRIES]


def _varied(node: NodeDescription, entries: Sequence[PdoMappingEntry]) -> list[PdoMappingEntry]:
    """*entries* with the first of each access and kind ahead, since either may cause a refusal."""
    known = {} if node.dictionary is None else _features(node.dictionary, entries)
    first: dict[Features | None, PdoMappingEntry] = {}
    for entry in entries:
        first.setdefault(known.get(entry), entry)
    return [*first.values(), *(entry for entry in entries if entry not in first.values())]


def _mappable(dictionary: ObjectDictionary, direction: Direction) -> Iterator[PdoMappingEntry]:
    """The mappable objects in the file; those for this direction only before those for both."""
    wanted = FEEDS_TPDO if direction is Direction.TPDO else TAKES_RPDO
    objects = [(entry.access, mapping) for entry, mapping in _marked(dictionary) if entry.access in wanted]
    for _, mapping in sorted(objects, key=lambda mappable: mappable[0] in FEEDS_TPDO & TAKES_RPDO):
        yield mapping


def _marked(dictionary: ObjectDictionary) -> Iterator[tuple[OdEntry, PdoMappingEntry]]:
    """Objects of a tried length marked as mappable in the file, without communication parameters."""
    return _whole(entry for entry in dictionary.entries() if entry.pdo_mapping and entry.index >= 0x2000)


def _whole(entries: Iterable[OdEntry]) -> Iterator[tuple[OdEntry, PdoMappingEntry]]:
    """The *entries* of a tried length, each with the mapping entry of the whole object."""
    for entry in entries:
        if entry.bits in _LENGTHS:
            yield entry, PdoMappingEntry(entry.index, entry.sub_index, entry.bits)


def _by_access(dictionary: ObjectDictionary) -> dict[str, tuple[PdoMappingEntry, ...]]:
    found: dict[str, list[tuple[OdEntry, PdoMappingEntry]]] = {}
    for entry, mapping in _marked(dictionary):
        found.setdefault(str(entry.access), []).append((entry, mapping))
    return {access: _one_of_each(objects) for access, objects in found.items()}


def _one_of_each(objects: Iterable[tuple[OdEntry, PdoMappingEntry]]) -> tuple[PdoMappingEntry, ...]:
    """The first of *objects* per length and kind, in order."""
    found: dict[tuple[int, Kind | None], PdoMappingEntry] = {}
    for entry, mapping in objects:
        found.setdefault((mapping.bits, None if entry.data_type is None else entry.data_type.kind), mapping)
    return tuple(found.values())


def _features(dictionary: ObjectDictionary, objects: Iterable[PdoMappingEntry]) -> dict[PdoMappingEntry, Features]:
    found = {}
    for mapping in objects:
        entry = dictionary.entry(mapping.index, mapping.sub_index)
        if entry is not None:
            kind = "" if entry.data_type is None else str(entry.data_type.kind)
            found[mapping] = Features(str(entry.access), kind)
    return found


def _unmappable(dictionary: ObjectDictionary, pdo: Pdo) -> tuple[PdoMappingEntry, ...]:
    """Objects with the right access but marked as not mappable, one per length and kind."""
    wanted = FEEDS_TPDO if pdo.is_tpdo else TAKES_RPDO
    entries = (entry for entry in dictionary.entries() if entry.pdo_mapping is False and entry.access in wanted)
    return _one_of_each(_whole(entries))


def _absent(node: ReadableNode) -> int:
    """An index missing in the device."""
    for index in range(0x5FFE, 0x5F00, -1):
        if (node.dictionary is None or index not in node.dictionary) and _held(node, index, 0) is None:
            return index
    return 0x5FFE


def absences(
    node: ReadableNode, subjects: Sequence[ProbedPdo], on_look: Callable[[int, int], None] = lambda _done, _total: None
) -> tuple[Absence, ...]:
    """The objects of its file that *node* lacks, among those examined; empty without a file.

    *on_look* is called with the number of examined objects and the total.
    """
    if node.dictionary is None:
        return ()
    places = listed(node.dictionary, subjects)
    found: list[Absence] = []
    for done, (index, sub_indices) in enumerate(places.items()):
        on_look(done, len(places))
        found += _of_object(node, index, sub_indices)
    return tuple(found)


def _of_object(node: ReadableNode, index: int, sub_indices: Sequence[int]) -> Iterator[Absence]:
    """The missing entries at *index*; sub-index 0 alone never, since it stands for the whole object."""
    missing = []
    for sub_index in sub_indices:
        code = _missing(node, index, sub_index)
        if code is None:
            continue
        missing.append(Absence(index, sub_index, code))
        if sub_index == 0 and code == Abort.NO_OBJECT:
            yield missing[0]
            return
    if len(missing) == len(sub_indices):
        yield Absence(index, 0, missing[0].code)
    else:
        yield from (absence for absence in missing if absence.sub_index)


def _missing(node: ReadableNode, index: int, sub_index: int) -> int | None:
    """The abort code for a missing object; None if present or unreadable."""
    try:
        node.read_cache.upload(index, sub_index)
    except SdoAborted as aborted:
        return aborted.code if aborted.code in ABSENT else None
    return None


def read_device(node: ReadableNode, pdos: Mapping[Pdo, PdoConfig], known: Sequence[KnownAnswers]) -> ReadDevice:
    """The description of *node* with its initial *pdos* and the answers of the probes."""
    values = {}
    for place in TO_READ:
        with suppress(SdoAborted):  # unreadable objects are left out
            values[place] = node.read_cache.upload(*place)
    mapped = {way: [e for p, c in pdos.items() if p.direction is way for e in c.mapping] for way in Direction}
    for answers in known:
        mapped[answers.subject.pdo.direction] += answers.fits
        if answers.subject.other_way is not None and answers.accepted(OTHER_WAY):
            mapped[answers.subject.pdo.direction].append(answers.subject.other_way)
    mapped = {way: [entry for entry in entries if not entry.is_dummy] for way, entries in mapped.items()}
    places = {(entry.index, entry.sub_index) for entries in mapped.values() for entry in entries}
    lengths = {place: bits for place in places if (bits := node.length_of(*place)) is not None}
    own = {answers.subject.pdo: answers.subject.entries for answers in known}
    return ReadDevice(
        node_id=node.node_id,
        title=node.title,
        values=values,
        pdos=pdos,
        entries=own,
        mapped=mapped,
        lengths=lengths,
        bit_rate=node.bus.bitrate,
    )
