"""A concise DCF (CiA 302-3, 0x1F22): what a manager downloads to a node each time that it boots. Knows no node."""

from __future__ import annotations

_COUNT, _HEAD = 4, 7


def read_concise_dcf(data: bytes) -> dict[tuple[int, int], bytes]:
    """What it leaves in each object, by index and sub-index; ValueError where *data* is none.

    A number of entries (u32), then of each its index (u16), sub-index (u8), length (u32) and data; of several for one
    object the last one counts, since they are downloaded one after the other.
    """
    wanted, at = int.from_bytes(data[:_COUNT], "little"), _COUNT
    if len(data) < _COUNT:
        raise ValueError(f"{len(data)} bytes are too few for its number of entries")
    left: dict[tuple[int, int], bytes] = {}
    for number in range(1, wanted + 1):
        head, at = data[at : at + _HEAD], at + _HEAD
        size = int.from_bytes(head[3:], "little")
        if len(head) < _HEAD or at + size > len(data):
            raise ValueError(f"it ends in entry {number} of {wanted}")
        left[int.from_bytes(head[:2], "little"), head[2]] = data[at : at + size]
        at += size
    if at != len(data):
        raise ValueError(f"{len(data) - at} bytes are behind its {wanted} entries")
    return left
