"""PDOs at work: objects into frames at SYNC, frames into objects (CiA 301, 7.2.2).

Knows mappings and transmission types. Does not know whether a configuration is legal (`pdo_guard`) nor the NMT
state (`device`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import DUMMY_BITS, PdoMappingEntry, total_bits
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.domain.ports import Frame
from dvtcli.simulator.family import Family
from dvtcli.simulator.memory import Memory

SHORT_PDO, LONG_PDO = 0x8210, 0x8220
_COB_ID, _TRANSMISSION_TYPE, _SYNC_START = 1, 2, 6
_LAST_SYNCHRONOUS = 240


@dataclass(slots=True)
class _SyncCount:
    """Where a synchronous TPDO stands: SYNCs seen since its last frame, that frame's data, whether it has begun."""

    seen: int = 0
    sent: bytes | None = None
    started: bool = False


@dataclass(slots=True)
class _Waiting:
    """A synchronous RPDO's data, to be applied after *syncs* more SYNCs."""

    data: bytes
    syncs: int


class PdoExchange:
    """The PDOs of one device in OPERATIONAL; *emergency* builds the EMCY frames for an error code."""

    def __init__(self, memory: Memory, family: Family, emergency: Callable[[int], list[Frame]]) -> None:
        self._memory = memory
        self._family = family
        self._emergency = emergency
        self._counts: dict[Pdo, _SyncCount] = {}
        self._waiting: dict[Pdo, _Waiting] = {}
        self._pdos: dict[Direction, list[Pdo]] | None = None

    def forget(self, pdo: Pdo | None = None) -> None:
        """Start over with *pdo*, or with all of them, after its parameters or the NMT state changed."""
        self._pdos = None
        if pdo is None:
            self._counts.clear()
            self._waiting.clear()
        else:
            self._counts.pop(pdo, None)
            self._waiting.pop(pdo, None)

    def sync(self, counter: int | None) -> list[Frame]:
        """Apply synchronous RPDOs, then return the frames of the TPDOs due; *counter* is the SYNC's, 1..240."""
        self._apply_waiting()
        synchronous = (pdo for pdo in self._enabled(Direction.TPDO) if self._type(pdo) <= _LAST_SYNCHRONOUS)
        return [self.frame(pdo) for pdo in synchronous if self._is_due(pdo, counter)]

    def receive(self, frame: Frame) -> list[Frame]:
        """Take a frame into every RPDO that listens to it; returns the EMCY frames sent in answer."""
        answers: list[Frame] = []
        for pdo in self._enabled(Direction.RPDO):
            cob_id = self.cob_id(pdo)
            if (cob_id.can_id, cob_id.extended) == (frame.can_id, frame.extended):
                answers += self._receive(pdo, frame.data)
        return answers

    def frame(self, pdo: Pdo) -> Frame:
        """The frame a TPDO would carry now."""
        cob_id = self.cob_id(pdo)
        return Frame(cob_id.can_id, self._data(pdo), extended=cob_id.extended)

    def cob_id(self, pdo: Pdo) -> CobId:
        """The COB-ID of *pdo*; disabled where the node has no such object."""
        return CobId.from_raw(self._memory.number(pdo.communication_index, _COB_ID, missing=1 << 31) & 0xFFFF_FFFF)

    def mapping(self, pdo: Pdo) -> list[PdoMappingEntry]:
        """The active entries of *pdo*; empty for a multiplexed PDO."""
        count = self._memory.number(pdo.mapping_index, 0)
        if count > 64:
            return []
        raw = (self._memory.number(pdo.mapping_index, sub_index) for sub_index in range(1, count + 1))
        return [PdoMappingEntry.from_raw(each) for each in raw]

    def _enabled(self, direction: Direction) -> list[Pdo]:
        if self._pdos is None:
            self._pdos = {each: self._find_enabled(each) for each in Direction}
        return self._pdos[direction]

    def _find_enabled(self, direction: Direction) -> list[Pdo]:
        found = []
        for index in sorted(self._memory.indices()):
            pdo = Pdo.at(index)
            if pdo and index == pdo.communication_index and pdo.direction is direction and self.cob_id(pdo).valid:
                found.append(pdo)
        return found

    def _type(self, pdo: Pdo) -> int:
        return self._memory.number(pdo.communication_index, _TRANSMISSION_TYPE, missing=255)

    def _is_due(self, pdo: Pdo, counter: int | None) -> bool:
        count = self._counts.setdefault(pdo, _SyncCount())
        every = self._type(pdo)
        if every == 0:
            now = self._data(pdo)
            changed, count.sent = now != count.sent, now
            return changed
        start = self._memory.number(pdo.communication_index, _SYNC_START)
        if counter is not None and start and not count.started:
            count.started = counter == start
            return count.started
        count.seen = (count.seen + 1) % every
        return count.seen == 0

    def _data(self, pdo: Pdo) -> bytes:
        value, offset = 0, 0
        for entry in self.mapping(pdo):
            held = self._memory.number(entry.index, entry.sub_index)
            value |= (held & (1 << entry.bits) - 1) << offset
            offset += entry.bits
        return value.to_bytes((offset + 7) // 8, "little")[:8]

    def _receive(self, pdo: Pdo, data: bytes) -> list[Frame]:
        wanted = (total_bits(self.mapping(pdo)) + 7) // 8
        if len(data) < wanted:
            return self._emergency(SHORT_PDO)
        every = self._type(pdo)
        if every <= _LAST_SYNCHRONOUS:
            syncs = max(1, every) if self._family.rpdo_counts_syncs else 1
            known = self._waiting.get(pdo)
            self._waiting[pdo] = _Waiting(data, known.syncs if known else syncs)
        else:
            self._apply(pdo, data)
        return self._emergency(LONG_PDO) if len(data) > wanted else []

    def _apply_waiting(self) -> None:
        for pdo, waiting in list(self._waiting.items()):
            waiting.syncs -= 1
            if waiting.syncs <= 0:
                del self._waiting[pdo]
                self._apply(pdo, waiting.data)

    def _apply(self, pdo: Pdo, data: bytes) -> None:
        bits, offset = int.from_bytes(data, "little"), 0
        for entry in self.mapping(pdo):
            if entry.index not in DUMMY_BITS and self._memory.exists(entry.index, entry.sub_index):
                self._put(entry, bits >> offset & (1 << entry.bits) - 1)
            offset += entry.bits

    def _put(self, entry: PdoMappingEntry, value: int) -> None:
        """Replace the low bits of an object; what a short entry does not cover stays as it is."""
        held = self._memory.read(entry.index, entry.sub_index)
        size = len(held) or (entry.bits + 7) // 8
        others = int.from_bytes(held, "little") & ~((1 << entry.bits) - 1)
        both = (others | value) & (1 << 8 * size) - 1
        self._memory.write(entry.index, entry.sub_index, both.to_bytes(size, "little"))
