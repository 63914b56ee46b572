"""PDO exchange: objects into frames, frames into objects (CiA 301, 7.2.2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import (
    DISPATCHER_LISTS,
    DUMMY_BITS,
    EVENT_DRIVEN,
    SAM_MPDO,
    SCANNER_LISTS,
    Direction,
    Pdo,
    PdoMappingEntry,
    is_mpdo,
    listed_objects,
    total_bits,
)
from dvtcli.domain.ports import Frame
from dvtcli.domain.profile import ObjectAddress
from dvtcli.simulator.device.emergency import Emergencies
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.memory import Memory

LAST_SYNCHRONOUS = 240
_SYNC_RTR, _FIRST_EVENT_DRIVEN = 252, 254
NEVER = float("inf")


@dataclass(slots=True, eq=False, repr=False)
class EventTiming:
    """The times of an event-driven TPDO in seconds, 0 for none: minimum and maximum between two frames.

    The first frame is due at once: consumers learn the values when the node starts.
    """

    inhibit_s: float
    event_s: float
    sent: bytes | None = None
    inhibited_until_s: float = -NEVER
    event_due_s: float = NEVER
    #: when the next frame may be due without a change of the data
    due_s: float = -NEVER

    def is_due(self, data: bytes, now_s: float) -> bool:
        """True if a frame with *data* is sent at *now_s*, and count the frame as sent."""
        wanted = data != self.sent or now_s >= self.event_due_s
        if wanted and now_s >= self.inhibited_until_s:
            self._note(data, now_s)
            return True
        self.due_s = self.inhibited_until_s if wanted else max(self.event_due_s, self.inhibited_until_s)
        return False

    def _note(self, data: bytes, now_s: float) -> None:
        """Restart the event timer: from its own schedule while punctual, else from now, and after a change."""
        on_time = data == self.sent and now_s < self.event_due_s + self.event_s
        self.sent = data
        self.inhibited_until_s = now_s + self.inhibit_s if self.inhibit_s else -NEVER
        if self.event_s:
            self.event_due_s = (self.event_due_s if on_time else now_s) + self.event_s
        self.due_s = max(self.event_due_s, self.inhibited_until_s)


@dataclass(slots=True, eq=False, repr=False)
class Tpdo:
    """One enabled TPDO: its configuration, and its state since it was enabled or the node was started.

    *kind* is the transmission type, *start* the SYNC start value (0: none), *entries* the mapping in frame order.
    """

    can_id: int
    extended: bool
    rtr_allowed: bool
    kind: int
    start: int
    entries: tuple[PdoMappingEntry, ...]
    #: None until the first poll, or always if not event-driven
    timing: EventTiming | None = None
    #: of a multiplexed one: what sends a frame for each object; None for any other
    multiplexed: MultiplexedTpdo | None = None
    #: what was last sent by type 0, or sampled by type 252
    sample: bytes | None = field(default=None, repr=False)
    _seen: int = 0
    _started: bool = False

    @property
    def heeds_sync(self) -> bool:
        """True if the TPDO acts on SYNC."""
        return self.multiplexed is None and (self.kind <= LAST_SYNCHRONOUS or self.kind == _SYNC_RTR)

    @property
    def event_driven(self) -> bool:
        """True if the TPDO is sent on change and by its event timer."""
        return self.kind >= _FIRST_EVENT_DRIVEN or self.multiplexed is not None

    def is_due_at_sync(self, data: bytes, counter: int | None) -> bool:
        """True if a frame with *data* is sent at this SYNC; *counter* is 1..240 or None."""
        if self.kind == _SYNC_RTR:
            self.sample = data
            return False
        if self.kind == 0:
            changed, self.sample = data != self.sample, data
            return changed
        if counter is not None and self.start and not self._started:
            self._started = counter == self.start
            return self._started
        self._seen = (self._seen + 1) % self.kind
        return self._seen == 0

    def requested(self, data: bytes) -> bytes | None:
        """The data for a remote frame; None without a sample yet, or without remote frames."""
        if not self.rtr_allowed or self.multiplexed is not None:
            return None
        return self.sample if self.kind == _SYNC_RTR else data


_MOST_ENTRIES, _MOST_BYTES = 64, 8


def mapping_of(memory: Memory, mapping_index: int) -> tuple[PdoMappingEntry, ...]:
    """The active entries of the mapping parameter at *mapping_index*; none for a multiplexed PDO."""
    count = memory.number(mapping_index, 0)
    if count > _MOST_ENTRIES:
        return ()
    raw = (memory.number(mapping_index, sub_index) for sub_index in range(1, count + 1))
    return tuple(PdoMappingEntry.from_raw(each) for each in raw)


def collect(memory: Memory, entries: Iterable[PdoMappingEntry]) -> bytes:
    """The present bytes of *entries*, at most 8."""
    value, offset = 0, 0
    for entry in entries:
        held = memory.number(entry.index, entry.sub_index)
        value |= (held & (1 << entry.bits) - 1) << offset
        offset += entry.bits
    return value.to_bytes((offset + 7) // 8, "little")[:_MOST_BYTES]


def spread(memory: Memory, entries: Iterable[PdoMappingEntry], data: bytes) -> None:
    """Write *data* into the mapped objects, skipping dummies and missing objects."""
    bits, offset = int.from_bytes(data, "little"), 0
    for entry in entries:
        if entry.index not in DUMMY_BITS and memory.exists(entry.index, entry.sub_index):
            _put(memory, entry, bits >> offset & (1 << entry.bits) - 1)
        offset += entry.bits


def _put(memory: Memory, entry: PdoMappingEntry, value: int) -> None:
    """Replace the low bits of an object; the bits above a short entry stay."""
    held = memory.read(entry.index, entry.sub_index)
    size = len(held) or (entry.bits + 7) // 8
    others = int.from_bytes(held, "little") & ~((1 << entry.bits) - 1)
    both = (others | value) & (1 << 8 * size) - 1
    memory.write(entry.index, entry.sub_index, both.to_bytes(size, "little"))


SHORT_PDO, LONG_PDO, NO_MPDO_OBJECT, RPDO_TIMED_OUT = 0x8210, 0x8220, 0x8230, 0x8250
_COB_ID, _TRANSMISSION_TYPE, _INHIBIT_TIME, _EVENT_TIMER, _SYNC_START = 1, 2, 3, 5, 6


@dataclass(slots=True, eq=False, repr=False)
class _Rpdo:
    """One enabled RPDO; *waiting* is data to apply after *syncs* more SYNCs."""

    can_id: int
    extended: bool
    kind: int
    entries: tuple[PdoMappingEntry, ...]
    #: the count of a multiplexed one, 0 for any other
    mpdo: int = 0
    waiting: bytes | None = None
    syncs: int = 0
    #: whether a frame came since the last poll, and when the next one must have come (s)
    received: bool = False
    due_s: float = NEVER
    bytes_wanted: int = field(init=False)

    def __post_init__(self) -> None:
        self.bytes_wanted = MPDO_BYTES if self.mpdo else (total_bits(self.entries) + 7) // 8


class PdoExchange:
    """The PDOs of one device in OPERATIONAL; *due_s* is the time of the next `poll`, if nothing changes."""

    def __init__(self, memory: Memory, family: Family, errors: Emergencies) -> None:
        self._memory = memory
        self._family = family
        self._errors = errors
        self._tpdos: dict[Pdo, Tpdo] = {}
        self._rpdos: dict[Pdo, _Rpdo] = {}
        self._cob_ids: set[tuple[int, bool]] = set()
        #: how often `forget` was called: as long as it stays, `knows` answers the same
        self.forgotten = 0
        #: PDOs with changed parameters, None for all
        self._stale: set[Pdo] | None = None
        self.due_s = NEVER

    def forget(self, pdo: Pdo | None = None) -> None:
        """Restart *pdo*, or all PDOs, after a change of parameters or NMT state."""
        self.forgotten += 1
        if pdo is None:
            self._stale = None
        elif self._stale is not None:
            self._stale.add(pdo)

    def sync(self, counter: int | None) -> list[Frame]:
        """Apply synchronous RPDOs and return the frames of the TPDOs due; *counter* is the SYNC's, 1..240."""
        self._refresh()
        for rpdo in self._rpdos.values():
            if rpdo.waiting is not None:
                self._count_down(rpdo)
        frames = []
        for tpdo in self._tpdos.values():
            if tpdo.heeds_sync:
                data = collect(self._memory, tpdo.entries)
                if tpdo.is_due_at_sync(data, counter):
                    frames.append(Frame(tpdo.can_id, data, extended=tpdo.extended))
        return frames

    def receive(self, frame: Frame) -> list[Frame]:
        """Receive a frame into every RPDO with its CAN-ID; returns the resulting EMCY frames."""
        self._refresh()
        answers: list[Frame] = []
        for pdo, rpdo in self._rpdos.items():
            if rpdo.can_id == frame.can_id and rpdo.extended == frame.extended:
                answers += self._receive(pdo, rpdo, frame.data)
        return answers

    def knows(self, frame: Frame) -> bool:
        """True if *frame* has the COB-ID of a PDO."""
        self._refresh()
        return (frame.can_id, frame.extended) in self._cob_ids

    def request(self, frame: Frame) -> list[Frame]:
        """The TPDO requested by a remote *frame*, if its COB-ID and the family allow."""
        if not self._family.answers_remote_frames:
            return []
        self._refresh()
        answers = []
        for tpdo in self._tpdos.values():
            if tpdo.can_id == frame.can_id and tpdo.extended == frame.extended:
                data = tpdo.requested(collect(self._memory, tpdo.entries))
                if data is not None:
                    answers.append(Frame(tpdo.can_id, data, extended=tpdo.extended))
        return answers

    def poll(self, now_s: float) -> list[Frame]:
        """The frames due at *now_s* (s): event-driven TPDOs, and EMCYs for missing RPDOs."""
        self._refresh()
        self.due_s = NEVER
        frames: list[Frame] = []
        for pdo, tpdo in self._tpdos.items():
            if tpdo.event_driven:
                frames += self._poll_tpdo(pdo, tpdo, now_s)
        for pdo, rpdo in self._rpdos.items():
            if rpdo.received or rpdo.due_s < NEVER:
                frames += self._poll_rpdo(pdo, rpdo, now_s)
        return frames

    def _poll_tpdo(self, pdo: Pdo, tpdo: Tpdo, now_s: float) -> list[Frame]:
        if tpdo.multiplexed is not None:
            sent = tpdo.multiplexed.poll(now_s)
            self.due_s = min(self.due_s, tpdo.multiplexed.due_s)
            return [Frame(tpdo.can_id, data, extended=tpdo.extended) for data in sent]
        timing = tpdo.timing
        if timing is None:
            timing = tpdo.timing = EventTiming(*self._times_s(pdo))
        data = collect(self._memory, tpdo.entries)
        due = timing.is_due(data, now_s)
        self.due_s = min(self.due_s, timing.due_s)
        return [Frame(tpdo.can_id, data, extended=tpdo.extended)] if due else []

    def _times_s(self, pdo: Pdo) -> tuple[float, float]:
        """Inhibit time and event timer of a TPDO."""
        inhibit = self._memory.number(pdo.communication_index, _INHIBIT_TIME)
        return inhibit / 10_000, self._memory.number(pdo.communication_index, _EVENT_TIMER) / 1000

    def _poll_rpdo(self, pdo: Pdo, rpdo: _Rpdo, now_s: float) -> list[Frame]:
        """The EMCY after an RPDO's event timer, which restarts with each frame and expires once."""
        frames: list[Frame] = []
        if rpdo.received:
            rpdo.received = False
            event = self._memory.number(pdo.communication_index, _EVENT_TIMER)
            rpdo.due_s = now_s + event / 1000 if event else NEVER
        elif now_s >= rpdo.due_s:
            rpdo.due_s = NEVER
            frames = self._errors.set(pdo, RPDO_TIMED_OUT)
        self.due_s = min(self.due_s, rpdo.due_s)
        return frames

    def _refresh(self) -> None:
        """Reload the PDOs with changed parameters."""
        if self._stale is not None and not self._stale:
            return
        if self._stale is None:
            self._tpdos.clear()
            self._rpdos.clear()
        for pdo in sorted(self._all() if self._stale is None else self._stale):
            self._look_at(pdo)
        self._tpdos = dict(sorted(self._tpdos.items()))
        self._rpdos = dict(sorted(self._rpdos.items()))
        self._cob_ids = {(tpdo.can_id, tpdo.extended) for tpdo in self._tpdos.values()}
        self._cob_ids |= {(rpdo.can_id, rpdo.extended) for rpdo in self._rpdos.values()}
        self._stale = set()

    def _all(self) -> set[Pdo]:
        found = {Pdo.at(index) for index in self._memory.indices() if 0x1400 <= index < 0x1A00}
        return {pdo for pdo in found if pdo is not None}

    def _look_at(self, pdo: Pdo) -> None:
        self._tpdos.pop(pdo, None)
        self._rpdos.pop(pdo, None)
        index = pdo.communication_index
        raw = self._memory.number(index, _COB_ID, missing=1 << 31) & 0xFFFF_FFFF
        cob_id = CobId.from_raw(raw)
        if not cob_id.valid:
            return
        kind = self._memory.number(index, _TRANSMISSION_TYPE, missing=EVENT_DRIVEN)
        entries = mapping_of(self._memory, pdo.mapping_index)
        count = self._memory.number(pdo.mapping_index, 0)
        if pdo.direction is Direction.RPDO:
            mpdo = count if is_mpdo(count) else 0
            self._rpdos[pdo] = _Rpdo(cob_id.can_id, cob_id.extended, kind, entries, mpdo)
            return
        start = self._memory.number(index, _SYNC_START) if kind <= LAST_SYNCHRONOUS else 0
        tpdo = self._tpdos[pdo] = Tpdo(
            can_id=cob_id.can_id,
            extended=cob_id.extended,
            rtr_allowed=cob_id.rtr_allowed,
            kind=kind,
            start=start,
            entries=entries,
        )
        if is_mpdo(count):
            tpdo.multiplexed = MultiplexedTpdo(self._memory, pdo, count, *self._times_s(pdo))

    def _receive(self, pdo: Pdo, rpdo: _Rpdo, data: bytes) -> list[Frame]:
        rpdo.received = True
        self._memory.touch()
        if len(data) < rpdo.bytes_wanted:
            return self._errors.set(pdo, SHORT_PDO)
        if rpdo.mpdo:
            taken = take_mpdo(self._memory, rpdo.mpdo, data)
            return self._errors.clear(pdo) if taken else self._errors.set(pdo, NO_MPDO_OBJECT)
        if rpdo.kind <= LAST_SYNCHRONOUS:
            if rpdo.waiting is None:
                rpdo.syncs = max(1, rpdo.kind) if self._family.rpdo_counts_syncs else 1
            rpdo.waiting = data
        else:
            spread(self._memory, rpdo.entries, data)
        if len(data) == rpdo.bytes_wanted:
            return self._errors.clear(pdo)
        return self._errors.set(pdo, LONG_PDO) if self._family.reports_long_rpdos else []

    def _count_down(self, rpdo: _Rpdo) -> None:
        rpdo.syncs -= 1
        if rpdo.syncs <= 0 and rpdo.waiting is not None:
            data, rpdo.waiting = rpdo.waiting, None
            spread(self._memory, rpdo.entries, data)


MPDO_BYTES = 8
_TO_DESTINATION, _ALL_NODES = 0x80, 0
_VALUE_BYTES = 4
_NEVER = float("inf")


@dataclass(slots=True, eq=False, repr=False)
class MultiplexedTpdo:
    """One enabled multiplexed TPDO: a frame for each object that changed, all at the start and by the event timer.

    By source its objects are those of the scanner list; by destination the mapped object goes to all nodes, into the
    object of the same index there. *inhibit_s* is the minimum between two frames, *event_s* the event timer; 0: none.
    """

    memory: Memory
    pdo: Pdo
    count: int
    inhibit_s: float
    event_s: float
    #: when the next frame may be due without a change of an object (s)
    due_s: float = -_NEVER
    _sent: dict[ObjectAddress, bytes] = field(default_factory=dict)
    #: objects that wait for the inhibit time, in their order
    _waiting: dict[ObjectAddress, None] = field(default_factory=dict)
    _inhibited_until_s: float = -_NEVER
    _event_due_s: float = -_NEVER

    def poll(self, now_s: float) -> list[bytes]:
        """The data of the frames that are due at *now_s* (s)."""
        repeats = self.event_s > 0 and now_s >= self._event_due_s
        if repeats:
            self._event_due_s = now_s + self.event_s
        for place in self._objects():
            if repeats or self.memory.read(*place) != self._sent.get(place):
                self._waiting[place] = None
        frames: list[bytes] = []
        while self._waiting and now_s >= self._inhibited_until_s:
            place = next(iter(self._waiting))
            del self._waiting[place]
            frames.append(self._frame(place))
            if self.inhibit_s:
                self._inhibited_until_s = now_s + self.inhibit_s
        later_s = self._event_due_s if self.event_s else _NEVER
        self.due_s = min(later_s, self._inhibited_until_s) if self._waiting else later_s
        return frames

    def _objects(self) -> Iterator[ObjectAddress]:
        """The objects that the device has, and that fit."""
        for place in self._listed() if self.count == SAM_MPDO else self._mapped():
            if self.memory.exists(*place) and len(self.memory.read(*place)) <= _VALUE_BYTES:
                yield place

    def _listed(self) -> Iterator[ObjectAddress]:
        for index, sub_index in _entries(self.memory, SCANNER_LISTS):
            entry = listed_objects(index, self.memory.number(index, sub_index))
            if entry is not None:
                yield from ((entry.index, entry.sub_index + offset) for offset in range(max(entry.count, 1)))

    def _mapped(self) -> Iterator[ObjectAddress]:
        entry = PdoMappingEntry.from_raw(self.memory.number(self.pdo.mapping_index, 1))
        yield entry.index, entry.sub_index

    def _frame(self, place: ObjectAddress) -> bytes:
        value = self._sent[place] = self.memory.read(*place)
        node = self.memory.node_id if self.count == SAM_MPDO else _TO_DESTINATION | _ALL_NODES
        head = bytes([node]) + place[0].to_bytes(2, "little") + bytes([place[1]])
        return head + value.ljust(_VALUE_BYTES, b"\0")


def take_mpdo(memory: Memory, count: int, data: bytes) -> bool:
    """Write the value in *data*, a frame of an RPDO with *count*, into its object; False if it has none that it can.

    A frame that is for another node, or that the dispatcher list does not have, is no error.
    """
    node, index, sub_index = data[0] & ~_TO_DESTINATION, int.from_bytes(data[1:3], "little"), data[3]
    by_destination = bool(data[0] & _TO_DESTINATION)
    if by_destination is (count == SAM_MPDO):
        return True
    if not by_destination:
        places = list(_dispatched(memory, node, index, sub_index))
    else:
        places = [(index, sub_index)] if node in (_ALL_NODES, memory.node_id) else []
    written = [_write(memory, place, data[4:]) for place in places]
    return all(written)


def _dispatched(memory: Memory, node: int, index: int, sub_index: int) -> Iterator[ObjectAddress]:
    """The own objects that the object *index*:*sub_index* of *node* sets."""
    for own_list, own_sub in _entries(memory, DISPATCHER_LISTS):
        entry = listed_objects(own_list, memory.number(own_list, own_sub))
        if entry is None or entry.source is None or (entry.node_id, entry.source[0]) != (node, index):
            continue
        offset = sub_index - entry.source[1]
        if 0 <= offset < max(entry.count, 1):
            yield entry.index, entry.sub_index + offset


def _entries(memory: Memory, lists: range) -> Iterator[ObjectAddress]:
    """The entries of *lists*, up to the number in sub-index 0 of each."""
    for index in memory.dictionary.indices_among(lists):
        for sub_index in range(1, memory.number(index, 0) + 1):
            yield index, sub_index


def _write(memory: Memory, place: ObjectAddress, value: bytes) -> bool:
    """Write *value* into the object at *place*, if the device has it and it is written by RPDOs."""
    entry = memory.entry(*place)
    if not memory.exists(*place) or (entry is not None and not entry.access.writable):
        return False
    size = memory.size(*place)
    if size is None or size > _VALUE_BYTES:
        return False
    memory.write(*place, value[:size])
    return True
