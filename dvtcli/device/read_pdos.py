"""Read a node's PDOs, with or without an EDS; and the read cache of a node."""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import takewhile
from typing import NamedTuple, Protocol

from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import (
    SRDO_COB_IDS,
    SRDO_DIRECTION,
    CobId,
    taken_by_services,
    taken_on_another,
)
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.objects import (
    COB_ID_EMCY,
    COB_ID_SYNC,
    COB_ID_TIME,
    FURTHER_SDO_CHANNELS,
    FURTHER_SDO_SERVERS,
    IDENTITY,
    MODULE_LIST,
    SDO_CLIENTS,
    SRDO_COMMUNICATION,
)
from dvtcli.domain.pdo import (
    MAX_ENTRIES,
    MAX_PDO_NUMBER,
    PDO_INDICES,
    Direction,
    ListedObjects,
    Pdo,
    PdoCommunicationParameter,
    PdoConfig,
    PdoMappingEntry,
    is_mpdo,
    listed_objects,
)
from dvtcli.domain.ports import CanopenBus, SdoReader
from dvtcli.errors import SdoAborted, SdoProtocolError

#: Answers that mean "this device has no such object": devices choose freely among them.
ABSENT = frozenset({Abort.NO_OBJECT, Abort.NO_SUB_INDEX})
#: Those, and answers that say that an object can never be read; others may pass.
UNREADABLE = ABSENT | {Abort.WRITE_ONLY, Abort.UNSUPPORTED_ACCESS}
#: Every abort code, for a list that shows what can be shown.
WHATEVER = range(1 << 32)
#: Stands for the COB-ID of a PDO that has none: bit 31 set says that the PDO does not exist (CiA 301, 7.5.2.35).
_NO_COB_ID = CobId(0, valid=False)
#: Without an EDS every PDO up to this number is asked for; beyond it the first gap ends the search.
ALWAYS_PROBED = 4


def read_number(sdo: SdoReader, index: int, sub_index: int, size: int) -> int:
    """Read an unsigned number of *size* bytes. Raises SdoProtocolError for another length."""
    data = sdo.upload(index, sub_index)
    if not data or any(data[size:]):
        raise SdoProtocolError(
            f"0x{index:04X}:{sub_index:02X} answered {len(data)} bytes ({data[:8].hex(' ')}), expected {size}",
            place=f"{index:04X}:{sub_index:02X}",
        )
    return int.from_bytes(data[:size], "little")


def read_optional(sdo: SdoReader, index: int, sub_index: int, size: int) -> int | None:
    """Read an optional number; None if missing."""
    try:
        return read_number(sdo, index, sub_index, size)
    except SdoAborted as aborted:
        if aborted.code in ABSENT:
            return None
        raise


def read_identity(sdo: SdoReader, sub_index: int) -> int | None:
    """Read a part of the identity (0x1018); None after any refusal."""
    try:
        return read_number(sdo, IDENTITY, sub_index, 4)
    except SdoAborted:
        return None


def read_modules(sdo: SdoReader) -> tuple[int, ...] | None:
    """Read the module list (0x1027, CiA 301, 7.5.2.30): the modules' numbers in the EDS; None if it cannot be read.

    0, a slot without a module, is left out.
    """
    try:
        count = read_number(sdo, MODULE_LIST, 0, 1)
        slots = [read_number(sdo, MODULE_LIST, sub_index, 2) for sub_index in range(1, count + 1)]
    except (SdoAborted, SdoProtocolError):
        return None
    return tuple(number for number in slots if number)


def read_mpdo_lists(
    sdo: SdoReader, dictionary: ObjectDictionary | None, lists: range
) -> dict[tuple[int, int], ListedObjects]:
    """Read the used entries of the scanner or dispatcher *lists* by index and sub-index, as far as readable."""
    found: dict[tuple[int, int], ListedObjects] = {}
    for index in lists if dictionary is None else dictionary.indices_among(lists):
        try:
            count = read_number(sdo, index, 0, 1)
            for sub_index in range(1, count + 1):
                entry = listed_objects(index, read_number(sdo, index, sub_index, 8))
                if entry is not None:
                    found[index, sub_index] = entry
        except (SdoAborted, SdoProtocolError):
            if dictionary is None:
                break  # the lists have no gap
    return found


def learnt_objects(
    entries: Iterable[PdoMappingEntry], upload: Callable[[int, int], bytes]
) -> tuple[dict[tuple[int, int], int], dict[tuple[int, int], int]]:
    """Find the lengths of mapped objects without a description in a file, by one upload each.

    Returns the lengths in bits of readable objects, and the abort codes of objects missing in the device. Unreadable
    (write-only) objects are in neither.
    """
    lengths: dict[tuple[int, int], int] = {}
    absent: dict[tuple[int, int], int] = {}
    for place in dict.fromkeys((entry.index, entry.sub_index) for entry in entries if not entry.is_dummy):
        try:
            lengths[place] = 8 * len(upload(*place))
        except SdoAborted as aborted:
            if aborted.code in ABSENT:
                absent[place] = aborted.code
    return lengths, absent


def sdo_channel_places(sdo: SdoReader, dictionary: ObjectDictionary | None) -> Iterator[tuple[int, int]]:
    """The COB-IDs of further SDO servers and clients, from the EDS, else by asking the node.

    Source: CiA 301, 7.5.2.33 and 7.5.2.34.
    """
    for channels in (FURTHER_SDO_SERVERS, SDO_CLIENTS):
        if dictionary is None:
            indices: Iterable[int] = takewhile(partial(_has, sdo), channels)
        else:
            indices = dictionary.indices_among(channels)
        yield from ((index, sub_index) for index in indices for sub_index in (1, 2))
    safety = () if dictionary is None else dictionary.indices_among(SRDO_COMMUNICATION)
    yield from ((index, sub_index) for index in safety for sub_index in (SRDO_DIRECTION, *SRDO_COB_IDS))


def _has(sdo: SdoReader, index: int) -> bool:
    try:
        read_number(sdo, index, 1, 4)
    except SdoAborted as aborted:
        return aborted.code not in ABSENT
    return True


def sdo_channels(sdo: SdoReader, dictionary: ObjectDictionary | None) -> dict[tuple[int, int], int]:
    """The readable COB-IDs of further SDO channels and of SRDOs, with their directions, by index and sub-index."""
    found: dict[tuple[int, int], int] = {}
    for index, sub_index in sdo_channel_places(sdo, dictionary):
        with suppress(SdoAborted, SdoProtocolError):
            found[index, sub_index] = read_number(sdo, index, sub_index, 4)
    return found


def service_ids(sdo: SdoReader, node_id: int, dictionary: ObjectDictionary | None) -> dict[tuple[int, bool], str]:
    """The CAN-IDs used by services of a node: CAN-ID, true for 29 bits, and a description.

    From 0x1005, 0x1012, 0x1014 and SDO channels. If the node lacks SYNC or EMCY, the standard's default counts. A
    disabled EMCY uses no CAN-ID, nor does a time stamp the node does not send.
    """
    sync, emcy = read_optional(sdo, COB_ID_SYNC, 0, 4), read_optional(sdo, COB_ID_EMCY, 0, 4)
    time = read_optional(sdo, COB_ID_TIME, 0, 4) if dictionary is None or COB_ID_TIME in dictionary else None
    return taken_by_services(node_id, sync, emcy, sdo_channels(sdo, dictionary), time)


def service_ids_beside(
    sdo: SdoReader, node_id: int, dictionary: ObjectDictionary | None, *, without: int | None = None
) -> dict[tuple[int, bool], str]:
    """As `service_ids` for another node: unreadable services count as unused.

    Ignores 0x1005, 0x1012, 0x1014, or all SDO channels and SRDOs where the index *without* is one of them.
    """
    held: dict[int, int | None] = dict.fromkeys((COB_ID_SYNC, COB_ID_TIME, COB_ID_EMCY))
    for index in held:
        if index != without and (dictionary is None or index in dictionary):
            with suppress(SdoAborted, SdoProtocolError):
                held[index] = read_optional(sdo, index, 0, 4)
    of_any = without in FURTHER_SDO_CHANNELS or without in SRDO_COMMUNICATION
    channels = {} if of_any else sdo_channels(sdo, dictionary)
    return taken_on_another(node_id, held[COB_ID_SYNC], held[COB_ID_EMCY], channels, held[COB_ID_TIME])


def read_cob_id(sdo: SdoReader, pdo: Pdo) -> CobId:
    """Read the COB-ID of *pdo* (sub-index 1 of its communication parameter)."""
    return CobId.from_raw(read_number(sdo, pdo.communication_index, 1, 4))


def read_pdo(sdo: SdoReader, pdo: Pdo, passing: Container[int] = UNREADABLE) -> PdoConfig:
    """Read communication parameter and active mapping of *pdo*, as far as readable.

    Sub-index 4 is never read; sub-indices 2, 3, 5 and 6 are each optional (CiA 301, 7.5.2.35/37). Entries are read up
    to the count only, since fillers follow. An abort code in *passing* leaves the parameter out and makes the PDO
    inconsistent, except for an optional parameter that is absent or never readable. Raises SdoAborted if neither COB-ID
    nor mapping is readable.
    """
    reader = _PdoReader(sdo, passing)
    cob_id = reader.number(pdo.communication_index, 1, 4)
    communication = _communication(reader, pdo, cob_id)
    count = reader.number(pdo.mapping_index, 0, 1)
    if cob_id is None and count is None and reader.first is not None and reader.first.code in ABSENT:
        raise reader.first
    if count is None or is_mpdo(count):
        first = None if count is None else reader.optional(pdo.mapping_index, 1, 4)
        entries = () if first is None else (PdoMappingEntry.from_raw(first),)
        return PdoConfig(communication, (), mpdo=count, unread=tuple(reader.unread), multiplexed=entries)
    words = list(takewhile(lambda word: word is not None, _entries(reader, pdo, count)))
    mapping = tuple(PdoMappingEntry.from_raw(word) for word in words if word is not None)
    odd = None if count == len(mapping) else count
    return PdoConfig(communication, mapping, held_count=odd, unread=tuple(reader.unread))


def _communication(reader: _PdoReader, pdo: Pdo, cob_id: int | None) -> PdoCommunicationParameter:
    index = pdo.communication_index
    if reader.first is not None and reader.first.code == Abort.NO_OBJECT:
        return PdoCommunicationParameter(_NO_COB_ID)
    return PdoCommunicationParameter(
        cob_id=_NO_COB_ID if cob_id is None else CobId.from_raw(cob_id),
        transmission_type=reader.optional(index, 2, 1),
        inhibit_time=reader.optional(index, 3, 2),
        event_timer=reader.optional(index, 5, 2),
        sync_start_value=reader.optional(index, 6, 1) if pdo.is_tpdo else None,
    )


def _entries(reader: _PdoReader, pdo: Pdo, count: int) -> Iterator[int | None]:
    return (reader.number(pdo.mapping_index, number, 4) for number in range(1, min(count, MAX_ENTRIES) + 1))


@dataclass(slots=True, eq=False, repr=False)
class _PdoReader:
    """The answers of a device about one PDO: *unread* are the unreadable places, *first* the first refusal."""

    sdo: SdoReader
    passing: Container[int]
    unread: list[tuple[int, int]] = field(default_factory=list)
    first: SdoAborted | None = None

    def number(self, index: int, sub_index: int, size: int) -> int | None:
        """A mandatory number, None after an abort code in *passing*."""
        try:
            return read_number(self.sdo, index, sub_index, size)
        except SdoAborted as aborted:
            if int(aborted.code) not in self.passing:  # `in` counts up to an IntEnum in a range
                raise
            self.first = self.first or aborted
            self.unread.append((index, sub_index))
            return None

    def optional(self, index: int, sub_index: int, size: int) -> int | None:
        """An optional number, *unread* after a temporary refusal."""
        try:
            return read_number(self.sdo, index, sub_index, size)
        except SdoAborted as aborted:
            if int(aborted.code) not in self.passing:  # `in` counts up to an IntEnum in a range
                raise
            if aborted.code not in UNREADABLE:
                self.unread.append((index, sub_index))
            return None


def present_pdos(sdo: SdoReader, dictionary: ObjectDictionary | None) -> list[Pdo]:
    """The PDOs of the node, TPDOs first: from the EDS, even incomplete, or by asking the node without an EDS."""
    if dictionary is None:
        return [pdo for direction in (Direction.TPDO, Direction.RPDO) for pdo in _probe(sdo, direction)]
    listed = {pdo for pdo in map(Pdo.at, dictionary.indices_among(PDO_INDICES)) if pdo is not None}
    return sorted(listed, key=lambda pdo: (not pdo.is_tpdo, pdo.number))


def _probe(sdo: SdoReader, direction: Direction) -> Iterator[Pdo]:
    for number in range(1, MAX_PDO_NUMBER + 1):
        pdo = Pdo(direction, number)
        if exists(sdo, pdo):
            yield pdo
        elif number > ALWAYS_PROBED:
            return


def exists(sdo: SdoReader, pdo: Pdo) -> bool:
    """True if the node has *pdo* or half of it: a COB-ID or a mapping count.

    A permanent refusal of both counts as present for the first `ALWAYS_PROBED` only: some devices refuse everything so.
    Raises SdoAborted if both refusals are temporary.
    """
    refused: list[SdoAborted] = []
    for index, sub_index in ((pdo.communication_index, 1), (pdo.mapping_index, 0)):
        try:
            read_number(sdo, index, sub_index, 4)
        except SdoAborted as aborted:
            refused.append(aborted)
        else:
            return True
    odd = next((aborted for aborted in refused if aborted.code not in ABSENT), None)
    if odd is not None and odd.code not in UNREADABLE:
        raise odd
    return odd is not None and pdo.number <= ALWAYS_PROBED


class OnBus(Protocol):
    """An object, such as a node, reached over a bus."""

    @property
    def bus(self) -> CanopenBus:
        """The bus."""


def read_side_by_side(nodes: Iterable[OnBus], jobs: Sequence[Callable[[], None]]) -> None:
    """Run *jobs*, each of which reads one of *nodes*, all on one bus; raises Ctrl-C, and the loss of the bus."""
    bus = next((node.bus for node in nodes), None)
    if bus is not None and (faults := bus.side_by_side(jobs)):
        raise faults[0]


@dataclass(slots=True, eq=False, repr=False)
class ReadCache:
    """The objects read from *node_id* on *bus*, by index and sub-index; *channel* reads the others.

    Used like the node's SDO channel, for values and refusals. Expires after a restart, a lost answer, or a write by
    another SDO client; own writes, and releasing the node to others, must call `forget`. Never use the cache for a
    read-back: read the channel itself.
    """

    bus: CanopenBus
    node_id: int
    channel: Callable[[], SdoReader]
    #: called with each object (index, sub-index) before its upload
    on_read: Callable[[int, int], None] = lambda _index, _sub_index: None
    _read: dict[tuple[int, int], bytes | SdoAborted] = field(default_factory=dict)
    _expired: int = 0
    #: the node's events at the first read
    _seen: tuple[int, int] = (0, 0)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """The cached value, or read now. Raises the errors of the channel."""
        self.bus.drain()
        return self.upload_known(index, sub_index, timeout_s=timeout_s, retries=retries)

    def upload_known(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """As `upload`, judging expiry by frames received so far, without receiving more."""
        self._drop_what_may_be_old()
        if (index, sub_index) not in self._read:
            self._read[index, sub_index] = self._asked(index, sub_index, timeout_s, retries)
        held = self._read[index, sub_index]
        if isinstance(held, SdoAborted):
            raise SdoAborted(index, sub_index, held.code, node=self.node_id)
        return held

    def expired(self) -> int:
        """A counter that grows whenever a value expires; unchanged, results computed from the values are still valid.

        Judges expiry as `upload_known`.
        """
        self._drop_what_may_be_old()
        return self._expired

    def look(self) -> CacheLook:
        """A faster view for consecutive reads without other work between.

        Checks the frames that have arrived once and during exchanges, not for each object.
        """
        self.bus.drain()
        return CacheLook(self)

    def _asked(self, index: int, sub_index: int, timeout_s: float | None, retries: int | None) -> bytes | SdoAborted:
        self.on_read(index, sub_index)
        try:
            return self.channel().upload(index, sub_index, timeout_s=timeout_s, retries=retries)
        except SdoAborted as aborted:
            return aborted

    def forget(self) -> None:
        """Expire all values except the identity, which only a restart can change."""
        self._expired += 1
        self._read = {place: held for place, held in self._read.items() if place[0] == IDENTITY}

    def forget_one(self, index: int, sub_index: int) -> None:
        """Expire one object."""
        self._expired += 1
        self._read.pop((index, sub_index), None)

    def forget_objects(self, indices: Collection[int]) -> None:
        """Expire the objects at *indices*."""
        self._expired += 1
        self._read = {place: held for place, held in self._read.items() if place[0] not in indices}

    def learn(self, other: ReadCache) -> None:
        """Copy the values of *other*, a cache of the same node."""
        self._expired += 1
        self._read, self._seen = dict(other._read), other._seen

    def clear(self) -> None:
        """Expire everything, after a gap in monitoring or a possible replacement of the device."""
        self._expired += 1
        self._read.clear()

    def is_of_now(self) -> bool:
        """True if the cache has a value read since the last possible change."""
        return bool(self._read) and self._seen[0] == self.bus.disturbance_count(self.node_id)

    def _drop_what_may_be_old(self) -> None:
        happened = self.bus.happened(self.node_id)
        if happened != self._seen:
            self._seen = happened
            self.clear()


class CacheLook(NamedTuple):
    """A view of *cache* (`ReadCache.look`)."""

    cache: ReadCache

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """The cached value, or read now. Raises the errors of the channel."""
        return self.cache.upload_known(index, sub_index, timeout_s=timeout_s, retries=retries)
