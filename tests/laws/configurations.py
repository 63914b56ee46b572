"""Random PDO configurations made from a family's own dictionary: legal ones by construction, and wild ones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from hypothesis import strategies as st

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_dictionary import Access, ObjectDictionary
from dvtcli.domain.pdo import DUMMY_BITS, Direction, Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.profile import BitPolicy, DeviceProfile
from tests.laws.bench import dictionary, profile

#: CAN-IDs that nothing else uses on any of the families' nodes.
FREE = [*range(0x190, 0x1A0), *range(0x3A0, 0x3B0), *range(0x680, 0x6E0)]
_SOURCES = {Access.RO, Access.RWR, Access.CONST}
_TARGETS = {Access.WO, Access.RWW, Access.RW}


@cache
def mappable(family: str, direction: Direction) -> list[PdoMappingEntry]:
    """Whole objects that the file lets a PDO of *direction* carry."""
    wanted = _SOURCES if direction is Direction.TPDO else _TARGETS
    return [
        PdoMappingEntry(entry.index, entry.sub_index, entry.bits)
        for entry in dictionary(family).entries()
        if entry.pdo_mapping and entry.access in wanted and entry.bits is not None and entry.bits <= 64
    ]


@cache
def fitting(family: str, direction: Direction) -> st.SearchStrategy[PdoMappingEntry]:
    """Those that the family takes as they are; one strategy for all draws, since making one costs more than drawing."""
    behaviour = profile(family)
    whole = [e for e in mappable(family, direction) if e.bits % (behaviour.granularity or 1) == 0]
    return st.sampled_from([e for e in whole if e.bits <= behaviour.max_entry_bits])


@cache
def any_entry(family: str, direction: Direction) -> st.SearchStrategy[PdoMappingEntry]:
    """Entries that may break any rule of a mapping."""
    described = dictionary(family)
    whole = st.sampled_from(mappable(family, direction))
    some_object = st.sampled_from([*described.entries()])
    return st.one_of(
        whole,
        some_object.map(lambda e: PdoMappingEntry(e.index, e.sub_index, min(e.bits or 8, 64))),
        st.builds(lambda e, bits: replace(e, bits=bits), whole, st.integers(0, 72)),
        st.builds(PdoMappingEntry, st.sampled_from([0, 1, 2, 5, 8, 0x5FFF]), st.integers(0, 2), st.integers(0, 64)),
        st.sampled_from([PdoMappingEntry(index, 0, bits) for index, bits in DUMMY_BITS.items()]),
        st.builds(PdoMappingEntry, st.sampled_from(list(described)), st.integers(0, 255), st.sampled_from([8, 16])),
    )


def room(described: ObjectDictionary, family: DeviceProfile, pdo: Pdo) -> int:
    """How many entries a mapping of *pdo* may have."""
    subs = len(described[pdo.mapping_index].entries) - 1
    return min(subs, family.max_entries or 64)


def kinds(family: DeviceProfile, pdo: Pdo) -> list[int]:
    """Transmission types that *pdo* may have whatever bit 30 is."""
    some = [0, 1, 2, 10, 239, 240, 254, 255]
    return [kind for kind in some if family.allows_type(kind)]


@st.composite
def legal(draw: st.DrawFn, family: str, pdo: Pdo, held: PdoConfig) -> PdoConfig:
    """A configuration that the family takes; it has the optional sub-indices that *held* has."""
    described, behaviour = dictionary(family), profile(family)
    count = draw(st.integers(0, room(described, behaviour, pdo)))
    candidates = fitting(family, pdo.direction)
    mapping: list[PdoMappingEntry] = []
    for entry in draw(st.lists(candidates, min_size=count, max_size=count, unique=True)):
        if sum(e.bits for e in mapping) + entry.bits <= 64:
            mapping.append(entry)
    policy = behaviour.rtr_bit[pdo.direction]
    rtr = draw(st.booleans()) if policy is BitPolicy.KEEP else policy is BitPolicy.CLEAR
    cob_id = CobId(draw(st.sampled_from(FREE)), draw(st.booleans()) and bool(mapping), rtr)
    if behaviour.extended_ids and draw(st.integers(0, 4)) == 0:
        cob_id = replace(cob_id, can_id=draw(st.integers(0, 0x1FFF_FFFF)), extended=True)
    return replace(_with_times(draw, family, pdo, held, cob_id), mapping=tuple(mapping))


def _with_times(draw: st.DrawFn, family: str, pdo: Pdo, held: PdoConfig, cob_id: CobId) -> PdoConfig:
    behaviour, was = profile(family), held.communication
    most = min(behaviour.max_time_count, 0x7FFF)

    def pick(present: int | None, values: st.SearchStrategy[int]) -> int | None:
        return None if present is None else draw(st.just(present) | values)

    return replace(
        held,
        communication=replace(
            was,
            cob_id=cob_id,
            transmission_type=pick(was.transmission_type, st.sampled_from(kinds(behaviour, pdo))),
            inhibit_time=pick(was.inhibit_time, st.integers(0, most)),
            event_timer=pick(was.event_timer, st.integers(0, most)),
            sync_start_value=pick(was.sync_start_value, st.integers(0, 240)),
        ),
    )


@st.composite
def wild(draw: st.DrawFn, family: str, pdo: Pdo, held: PdoConfig) -> PdoConfig:
    """A configuration that may break any rule, in one place or in many."""
    was = held.communication

    def or_kept(values: st.SearchStrategy[int], present: int | None) -> int | None:
        return draw(values) if present is not None and draw(st.booleans()) else present

    raw = st.one_of(
        st.integers(0, 0xFFFF_FFFF),
        st.builds(lambda can_id, flags: can_id | flags << 29, st.integers(0, 0x7FF), st.integers(0, 7)),
        st.just(was.cob_id.raw),
        st.sampled_from(FREE).map(lambda can_id: can_id | was.cob_id.raw & 0x4000_0000),
    )
    communication = replace(
        was,
        cob_id=CobId.from_raw(draw(raw)),
        transmission_type=or_kept(st.integers(0, 255), was.transmission_type),
        inhibit_time=or_kept(st.integers(0, 0xFFFF), was.inhibit_time),
        event_timer=or_kept(st.integers(0, 0xFFFF), was.event_timer),
        sync_start_value=or_kept(st.integers(0, 255), was.sync_start_value),
    )
    mapping = (
        held.mapping if draw(st.booleans()) else tuple(draw(st.lists(any_entry(family, pdo.direction), max_size=9)))
    )
    return replace(held, communication=communication, mapping=mapping)
