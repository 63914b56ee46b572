"""Multiplexed PDOs of a simulated device at work: frames that name their node and object (CiA 301, 7.2.2.6)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from dvtcli.domain.pdo import DISPATCHER_LISTS, SAM_MPDO, SCANNER_LISTS, Pdo, PdoMappingEntry, listed_objects
from dvtcli.simulator.device.memory import Memory

MPDO_BYTES = 8
_TO_DESTINATION, _ALL_NODES = 0x80, 0
_VALUE_BYTES = 4
_NEVER = float("inf")
_Place = tuple[int, int]


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
    _sent: dict[_Place, bytes] = field(default_factory=dict)
    #: objects that wait for the inhibit time, in their order
    _waiting: dict[_Place, None] = field(default_factory=dict)
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

    def _objects(self) -> Iterator[_Place]:
        """The objects that the device has, and that fit."""
        for place in self._listed() if self.count == SAM_MPDO else self._mapped():
            if self.memory.exists(*place) and len(self.memory.read(*place)) <= _VALUE_BYTES:
                yield place

    def _listed(self) -> Iterator[_Place]:
        for index, sub_index in _entries(self.memory, SCANNER_LISTS):
            entry = listed_objects(index, self.memory.number(index, sub_index))
            if entry is not None:
                yield from ((entry.index, entry.sub_index + offset) for offset in range(max(entry.count, 1)))

    def _mapped(self) -> Iterator[_Place]:
        entry = PdoMappingEntry.from_raw(self.memory.number(self.pdo.mapping_index, 1))
        yield entry.index, entry.sub_index

    def _frame(self, place: _Place) -> bytes:
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


def _dispatched(memory: Memory, node: int, index: int, sub_index: int) -> Iterator[_Place]:
    """The own objects that the object *index*:*sub_index* of *node* sets."""
    for own_list, own_sub in _entries(memory, DISPATCHER_LISTS):
        entry = listed_objects(own_list, memory.number(own_list, own_sub))
        if entry is None or entry.source is None or (entry.node_id, entry.source[0]) != (node, index):
            continue
        offset = sub_index - entry.source[1]
        if 0 <= offset < max(entry.count, 1):
            yield entry.index, entry.sub_index + offset


def _entries(memory: Memory, lists: range) -> Iterator[_Place]:
    """The entries of *lists*, up to the number in sub-index 0 of each."""
    for index in memory.dictionary.indices_among(lists):
        for sub_index in range(1, memory.number(index, 0) + 1):
            yield index, sub_index


def _write(memory: Memory, place: _Place, value: bytes) -> bool:
    """Write *value* into the object at *place*, if the device has it and it is written by RPDOs."""
    entry = memory.entry(*place)
    if not memory.exists(*place) or (entry is not None and not entry.access.writable):
        return False
    size = memory.size(*place)
    if size is None or size > _VALUE_BYTES:
        return False
    memory.write(*place, value[:size])
    return True
