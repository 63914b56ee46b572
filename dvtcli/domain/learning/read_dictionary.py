"""Object dictionary of a device without a file, as far as `learn` read it. Pure; reads nothing.

A mapped object exists, is mappable, and has the length read; its access follows from its PDOs' direction.
All other objects, most of the device, are missing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from dvtcli.domain.abort import abort_text
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BOOLEAN, DATA_TYPES, U8, DataType, Kind
from dvtcli.domain.learning.probe import Learnt, Probe, ProbeAnswer, ProbedPdo, ProbeWrite, Stand
from dvtcli.domain.object_dictionary import Access, DeviceInfo, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.objects import COB_ID_EMCY, IDENTITY, RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.pdo import Direction, Pdo, PdoConfig, PdoMappingEntry, is_mapping_index
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE
from dvtcli.domain.standard_objects import standard_entry, standard_object_type

#: Names of the parameters: in the check, and for people.
_CHECKED = {
    TRANSMISSION_TYPE: ("type", "transmission type"),
    INHIBIT_TIME: ("inhibit", "inhibit time"),
    EVENT_TIMER: ("event", "event timer"),
    SYNC_START: ("sync-start", "SYNC start value"),
}
_COB_ID = 1
#: Transmission types that need bit 30 clear: refused for another reason.
_ON_REQUEST = (252, 253)


def limit_probes(subject: ProbedPdo) -> Iterator[Probe]:
    """A value below and a value above each communication parameter's limits, if the type allows."""
    index = subject.pdo.communication_index
    for sub_index, data in subject.parameters.items():
        if (index, sub_index) not in subject.limits or sub_index not in _CHECKED:
            continue
        low, high = subject.limits[index, sub_index]
        check, what = _CHECKED[sub_index]
        for side, values in (("below", range(low - 1, low - 2, -1)), ("above", range(high + 1, high + 4))):
            value = next(
                (
                    candidate
                    for candidate in values
                    if 0 <= candidate < 1 << 8 * len(data) and not _rtr(sub_index, candidate)
                ),
                None,
            )
            if value is not None:
                write = ProbeWrite(index, sub_index, value.to_bytes(len(data), "little"))
                sense = f"{what} {value}, {side} the limit of the EDS, is accepted"
                name = f"{what} {side} its limit"
                yield Probe(
                    pdo=subject.pdo,
                    name=name,
                    sense=sense,
                    stand=Stand.EMPTY,
                    writes=(write,),
                    check=f"{check}-{side}-limit",
                )


def _rtr(sub_index: int, value: int) -> bool:
    return sub_index == TRANSMISSION_TYPE and value in _ON_REQUEST


def taken_beyond(subject: ProbedPdo, answers: Iterable[ProbeAnswer]) -> Mapping[str, ProbeAnswer]:
    """The first answer per limit check that accepted a value outside the limits."""
    found: dict[str, ProbeAnswer] = {}
    for answer in answers:
        for write in answer.probe.writes if answer.accepted else ():
            low, high = subject.limits.get((write.index, write.sub_index), (0, 1 << 64))
            value = int.from_bytes(write.data, "little")
            name = _name(write)
            if name and not low <= value <= high:
                found.setdefault(f"{name}-{'below' if value < low else 'above'}-limit", answer)
    return found


def _name(write: ProbeWrite) -> str:
    if is_mapping_index(write.index):
        return "entry" if write.sub_index else "count"
    return "cob-id" if write.sub_index == _COB_ID else _CHECKED.get(write.sub_index, ("", ""))[0]


#: Checked communication parameters: up to the PDOs' mappings.
_LOOKED_AT = range(0x1000, 0x1C00)


@dataclass(frozen=True, slots=True)
class Absence:
    """A missing object, sub-index 0 for a whole object, and its abort *code*."""

    index: int
    sub_index: int
    code: int

    @property
    def place(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.sub_index

    @property
    def name(self) -> str:
        """`1804` for a whole object, `1803:05` for a sub-index."""
        return f"{self.index:04X}:{self.sub_index:02X}" if self.sub_index else f"{self.index:04X}"


def listed(dictionary: ObjectDictionary, subjects: Iterable[ProbedPdo]) -> dict[int, list[int]]:
    """Sub-indices to check, by index: readable entries of fixed length, cheap to read."""
    mapped = {
        (entry.index, entry.sub_index) for subject in subjects for entry in (*subject.objects, *subject.unmappable)
    }
    places = {(entry.index, entry.sub_index) for index in dictionary if index in _LOOKED_AT for entry in
              dictionary[index].entries.values() if _short(entry)}  # fmt: skip
    places |= {place for place in mapped if (entry := dictionary.entry(*place)) is not None and _short(entry)}
    found: dict[int, list[int]] = {}
    for index, sub_index in sorted(places):
        found.setdefault(index, []).append(sub_index)
    return found


def _short(entry: OdEntry) -> bool:
    return entry.access.readable and entry.data_type is not None and entry.data_type.size is not None


def absent_for_family(absences: Collection[Absence]) -> Iterator[Learnt]:
    """Objects that a simulated device must lack too, with the same abort codes."""
    for absence in absences:
        place = f"0x{absence.name}"
        evidence = f"{place} is in the file, and reading it answered 0x{absence.code:08X} ({abort_text(absence.code)})"
        yield Learnt(f"absent.{absence.name}", absence.code, evidence)


#: COB-IDs of the predefined connection set follow the node-ID (CiA 301, 7.3.5).
_FUNCTIONS = (0x080, *range(0x180, 0x580, 0x80))
_NODE_IDS = 0x7F
#: Names of 0x1000 to 0x1FFF in a generated file.
_NAMES = {
    0x1000: "Device type", 0x1001: "Error register", 0x1005: "COB-ID SYNC message",
    0x1008: "Manufacturer device name", 0x1009: "Manufacturer hardware version",
    0x100A: "Manufacturer software version", 0x1010: "Store parameters", 0x1011: "Restore default parameters",
    0x1014: "COB-ID EMCY", 0x1017: "Producer heartbeat time", 0x1018: "Identity object",
}  # fmt: skip
_LISTS = (STORE_PARAMETERS, RESTORE_PARAMETERS, IDENTITY)
#: Objects to read among them; sub-indices of arrays and records up to 4.
TO_READ = tuple((index, sub) for index in _NAMES for sub in (range(1, 5) if index in _LISTS else (0,)))


@dataclass(frozen=True, slots=True)
class ReadDevice:
    """Data read from node *node_id*: *values* at `TO_READ`, *pdos*, and *entries* of probed PDOs.

    *mapped* are objects mapped per direction, with *lengths* in bits as read. *bit_rate* is the
    bus's (bit/s), None if unknown.
    """

    node_id: int
    title: str
    values: Mapping[tuple[int, int], bytes]
    pdos: Mapping[Pdo, PdoConfig]
    entries: Mapping[Pdo, tuple[int, ...]]
    mapped: Mapping[Direction, Iterable[PdoMappingEntry]]
    lengths: Mapping[tuple[int, int], int] = field(default_factory=dict)
    bit_rate: int | None = None


def described(read: ReadDevice) -> ObjectDictionary:
    """The object dictionary for the data *read*."""
    entries = [*_standard(read), *_parameters(read), *_mapped(read)]
    objects: dict[int, dict[int, OdEntry]] = {}
    for entry in entries:
        objects.setdefault(entry.index, {})[entry.sub_index] = entry
    numbers = {sub: int.from_bytes(read.values.get((IDENTITY, sub), b""), "little") for sub in (1, 2, 3)}
    count = {way: max((pdo.number for pdo in read.pdos if pdo.direction is way), default=0) for way in Direction}
    info = DeviceInfo(
        vendor_name="unknown", product_name=read.title or "unknown", vendor_id=numbers[1], product_code=numbers[2],
        revision_number=numbers[3], granularity=8, boot_up_master=False, boot_up_slave=True, dynamic_channels=0,
        group_messaging=False, lss_supported=False,
        bit_rates_kbit=() if read.bit_rate is None else (read.bit_rate // 1000,),
        rpdo_count=count[Direction.RPDO], tpdo_count=count[Direction.TPDO],
    )  # fmt: skip
    return ObjectDictionary({index: _object(index, subs) for index, subs in objects.items()}, info)


def _object(index: int, subs: dict[int, OdEntry]) -> OdObject:
    alone = set(subs) == {0} and standard_object_type(index) in (None, ObjectType.VAR)
    kind = ObjectType.VAR if alone else standard_object_type(index) or ObjectType.RECORD
    if not alone and 0 not in subs:
        subs = {0: OdEntry(index, 0, "Highest sub-index", U8, Access.RO, default=bytes([max(subs)])), **subs}
    pdo = Pdo.at(index)
    what = "" if pdo is None else "communication" if index == pdo.communication_index else "mapping"
    name = f"{pdo.label} {what} parameter" if pdo else _NAMES.get(index, f"Object {index:04X}")
    return OdObject(index, name, kind, dict(sorted(subs.items())))


def _standard(read: ReadDevice) -> Iterator[OdEntry]:
    for (index, sub_index), data in read.values.items():
        known = standard_entry(index, sub_index)
        if known is not None and (known.data_type.size in (None, len(data))):
            name = _NAMES[index] if standard_object_type(index) is ObjectType.VAR else f"Sub-index {sub_index}"
            follows = read.node_id if index == COB_ID_EMCY else 0
            yield _held(index, sub_index, name, known.data_type, known.access or Access.RW, data, follows)


def _parameters(read: ReadDevice) -> Iterator[OdEntry]:
    """PDO parameters, with the values read as defaults."""
    most = {way: max((len(e) for p, e in read.entries.items() if p.direction is way), default=0) for way in Direction}
    for pdo, config in read.pdos.items():
        index, own = pdo.communication_index, config.communication
        if config.has_cob_id:
            yield _held(index, 1, "COB-ID", *_type(index, 1), own.cob_id.raw.to_bytes(4, "little"), read.node_id)
        for sub, name, value in (
            (TRANSMISSION_TYPE, "Transmission type", own.transmission_type),
            (INHIBIT_TIME, "Inhibit time", own.inhibit_time),
            (EVENT_TIMER, "Event timer", own.event_timer),
            (SYNC_START, "SYNC start value", own.sync_start_value),
        ):
            if value is not None:
                kind, access = _type(index, sub)
                yield _held(index, sub, name, kind, access, value.to_bytes(kind.size or 1, "little"))
        if config.has_mapping:
            yield from _mapping(pdo, config, read.entries.get(pdo, ()), most[pdo.direction])


def _mapping(pdo: Pdo, config: PdoConfig, entries: tuple[int, ...], most: int) -> Iterator[OdEntry]:
    """Mapping entries as far as readable; a PDO that was not probed gets as many as the probed PDO."""
    index = pdo.mapping_index
    words = list(entries) or [entry.raw for entry in config.mapping]
    words += [0] * (most - len(words) if not entries else 0)
    yield _held(index, 0, "Number of mapped objects", *_type(index, 0), bytes([config.count]))
    for number, word in enumerate(words, 1):
        yield _held(index, number, f"Mapped object {number}", *_type(index, 1), word.to_bytes(4, "little"))


def _type(index: int, sub_index: int) -> tuple[DataType, Access]:
    """Type and access of a PDO parameter in CiA 301. Raises ValueError if it is not a PDO parameter."""
    known = standard_entry(index, sub_index)
    if known is None:
        raise ValueError(f"{index:04X}:{sub_index:02X} is not a parameter of a PDO")
    return known.data_type, known.access or Access.RW


def _mapped(read: ReadDevice) -> Iterator[OdEntry]:
    """Objects that a PDO maps or accepted in a probe."""
    ways: dict[tuple[int, int], set[Direction]] = {}
    bits: dict[tuple[int, int], int] = {}
    for way, entries in read.mapped.items():
        for entry in entries:
            place = entry.index, entry.sub_index
            ways.setdefault(place, set()).add(way)
            bits[place] = max(bits.get(place, 0), entry.bits)
    for (index, sub_index), seen in sorted(ways.items()):
        kind = _of_length(bits[index, sub_index], read.lengths.get((index, sub_index)))
        access = Access.RW if len(seen) > 1 else Access.RO if Direction.TPDO in seen else Access.RWW
        if kind is not None and index >= 0x2000:
            yield OdEntry(index, sub_index, f"Object {index:04X}:{sub_index:02X}", kind, access, pdo_mapping=True)


def _of_length(mapped: int, read: int | None) -> DataType | None:
    """The unsigned type for an object with *mapped* bits mapped and *read* bits read."""
    if mapped == 1 and read in (None, 8):
        return BOOLEAN
    wanted = read or mapped
    return next(
        (
            data_type
            for data_type in DATA_TYPES.values()
            if data_type.kind is Kind.UNSIGNED and data_type.bits == wanted
        ),
        None,
    )


def _held(
    index: int,
    sub_index: int,
    name: str,
    kind: DataType,
    access: Access,
    data: bytes,
    node_id: int = 0,
) -> OdEntry:
    """An entry whose default is *data*; a default COB-ID of *node_id* becomes relative to the node-ID."""
    if node_id:
        cob_id = CobId.from_raw(int.from_bytes(data, "little"))
        function = cob_id.can_id - node_id
        if cob_id.can_id & _NODE_IDS == node_id and (function in _FUNCTIONS):
            base = (cob_id.raw - node_id).to_bytes(4, "little")
            return OdEntry(index, sub_index, name, kind, access, default=base, default_relative=True)
    return OdEntry(index, sub_index, name, kind, access, default=data)
