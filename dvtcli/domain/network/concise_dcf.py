"""A concise DCF (CiA 302-3, 0x1F22): what a manager downloads to a node each time that it boots. Knows no node.

A number of entries (u32), then of each its index (u16), sub-index (u8), length (u32) and data, all least significant
byte first. Files of this form are what other tools write for a master.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: how names of such files end
SUFFIX = ".cdcf"
_COUNT, _HEAD = 4, 7


@dataclass(frozen=True, slots=True)
class ConciseEntry:
    """One download: *data* to the object at *index* and *sub_index*."""

    index: int
    sub_index: int
    data: bytes

    @property
    def object(self) -> str:
        """The object as it is printed and typed: `1A00:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"


def concise_entries(data: bytes) -> tuple[ConciseEntry, ...]:
    """Its entries in the order in which they are downloaded; ValueError where *data* is none."""
    wanted, at = int.from_bytes(data[:_COUNT], "little"), _COUNT
    if len(data) < _COUNT:
        raise ValueError(f"{len(data)} bytes are too few for its number of entries")
    found: list[ConciseEntry] = []
    for number in range(1, wanted + 1):
        head, at = data[at : at + _HEAD], at + _HEAD
        size = int.from_bytes(head[3:], "little")
        if len(head) < _HEAD or at + size > len(data):
            raise ValueError(f"it ends in entry {number} of {wanted}")
        found.append(ConciseEntry(int.from_bytes(head[:2], "little"), head[2], data[at : at + size]))
        at += size
    if at != len(data):
        raise ValueError(f"{len(data) - at} bytes are behind its {wanted} entries")
    return tuple(found)


def read_concise_dcf(data: bytes) -> dict[tuple[int, int], bytes]:
    """What it leaves in each object, by index and sub-index; ValueError where *data* is none.

    Of several entries for one object the last one counts, since they are downloaded one after the other.
    """
    return {(entry.index, entry.sub_index): entry.data for entry in concise_entries(data)}


def concise_bytes(entries: Sequence[ConciseEntry]) -> bytes:
    """*entries* as a concise DCF."""
    heads = (
        entry.index.to_bytes(2, "little")
        + bytes([entry.sub_index])
        + len(entry.data).to_bytes(4, "little")
        + entry.data
        for entry in entries
    )
    return len(entries).to_bytes(_COUNT, "little") + b"".join(heads)
