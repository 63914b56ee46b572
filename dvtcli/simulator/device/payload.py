"""What a PDO's mapping does: objects into the bytes of a frame, and back (CiA 301, 7.2.2.4).

Knows bit positions and dummy entries. Does not know when a PDO is sent or applied (`exchange`).
"""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.domain.mapping import DUMMY_BITS, PdoMappingEntry
from dvtcli.simulator.device.memory import Memory

_MOST_ENTRIES, _MOST_BYTES = 64, 8


def mapping_of(memory: Memory, mapping_index: int) -> tuple[PdoMappingEntry, ...]:
    """The active entries of the mapping parameter at *mapping_index*; none for a multiplexed PDO."""
    count = memory.number(mapping_index, 0)
    if count > _MOST_ENTRIES:
        return ()
    raw = (memory.number(mapping_index, sub_index) for sub_index in range(1, count + 1))
    return tuple(PdoMappingEntry.from_raw(each) for each in raw)


def collect(memory: Memory, entries: Iterable[PdoMappingEntry]) -> bytes:
    """The bytes that *entries* make up now, at most 8."""
    value, offset = 0, 0
    for entry in entries:
        held = memory.number(entry.index, entry.sub_index)
        value |= (held & (1 << entry.bits) - 1) << offset
        offset += entry.bits
    return value.to_bytes((offset + 7) // 8, "little")[:_MOST_BYTES]


def spread(memory: Memory, entries: Iterable[PdoMappingEntry], data: bytes) -> None:
    """Put *data* into the mapped objects; dummies and objects that the node does not have are skipped."""
    bits, offset = int.from_bytes(data, "little"), 0
    for entry in entries:
        if entry.index not in DUMMY_BITS and memory.exists(entry.index, entry.sub_index):
            _put(memory, entry, bits >> offset & (1 << entry.bits) - 1)
        offset += entry.bits


def _put(memory: Memory, entry: PdoMappingEntry, value: int) -> None:
    """Replace the low bits of an object; what a short entry does not cover stays as it is."""
    held = memory.read(entry.index, entry.sub_index)
    size = len(held) or (entry.bits + 7) // 8
    others = int.from_bytes(held, "little") & ~((1 << entry.bits) - 1)
    both = (others | value) & (1 << 8 * size) - 1
    memory.write(entry.index, entry.sub_index, both.to_bytes(size, "little"))
