"""Scanner and dispatcher lists: which objects multiplexed PDOs with source addressing carry (CiA 301, 7.2.2.5)."""

from __future__ import annotations

from dataclasses import dataclass

#: Scanner lists name what a node sends, dispatcher lists what it takes (CiA 301, 7.5.2.39 and 7.5.2.40).
SCANNER_LISTS, DISPATCHER_LISTS = range(0x1FA0, 0x1FD0), range(0x1FD0, 0x2000)


@dataclass(frozen=True, slots=True)
class ListedObjects:
    """Objects of a list's entry: *count* sub-indices from *index*:*sub_index* of this node on.

    In a dispatcher list they are set by the objects from *source* of the node *node_id* on; both are None in a scanner
    list.
    """

    index: int
    sub_index: int
    count: int = 1
    node_id: int | None = None
    source: tuple[int, int] | None = None

    @property
    def objects(self) -> str:
        """The objects of this node: `2001:01…2001:03`."""
        return _span(self.index, self.sub_index, self.count)

    @property
    def sources(self) -> str:
        """The objects of the other node, empty in a scanner list."""
        return "" if self.source is None else _span(*self.source, self.count)


def _span(index: int, sub_index: int, count: int) -> str:
    first = f"{index:04X}:{sub_index:02X}"
    return first if count <= 1 else f"{first}…{index:04X}:{sub_index + count - 1:02X}"


def listed_objects(index: int, raw: int) -> ListedObjects | None:
    """Return the objects of the entry *raw* of the list at *index*; None for an unused entry, or any other object."""
    if not raw:
        return None
    if index in SCANNER_LISTS:
        return ListedObjects(raw >> 8 & 0xFFFF, raw & 0xFF, raw >> 24 & 0xFF)
    if index in DISPATCHER_LISTS:
        source = (raw >> 16 & 0xFFFF, raw >> 8 & 0xFF)
        return ListedObjects(raw >> 40 & 0xFFFF, raw >> 32 & 0xFF, raw >> 56 & 0xFF, raw & 0xFF, source)
    return None
