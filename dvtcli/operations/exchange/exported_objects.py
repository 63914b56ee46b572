"""Export a node's heartbeats, guarding, SYNC, EMCY and time stamp to a network file. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import TYPE_CHECKING

from dvtcli.device.heartbeat_slots import heartbeat_slots
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.network.wanted_state import FileWord, HeartbeatWatch, ObjectWish, ValueWish
from dvtcli.errors import SdoAborted
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.operations.wanted.resolve_names import following

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.ports import SdoReader

#: whether a file has an object, by index and sub-index, even with its usual value
Said = Callable[[int, int], bool]

_CONSUMER, _EMCY, _BEHAVIOUR = 0x1016, 0x1014, 0x1029
#: bits 0 to 29 of a COB-ID: the CAN-ID and its 29-bit flag; EMCY of node-ID 0 (CiA 301, 7.3.5)
_IDENTIFIER, _EMCY_BASE = 0x3FFF_FFFF, 0x80
#: objects without a key: index, size in bytes, meaning
_WITHOUT_KEY = {
    (_EMCY, 4): "COB-ID of EMCY",
    (0x1015, 2): "inhibit time of EMCY, 100 µs",
    (0x1019, 1): "overflow of SYNC's counter",
}
#: default values (CiA 301, 7.5.2.5 to 7.5.2.15), which a file need not have
_USUAL = {0x1005: (0x80, 0x8000_0080), 0x1006: (0,), 0x100C: (0,), 0x100D: (0,), 0x1012: (0x100, 0x8000_0100)}


def all_of(dictionary: ObjectDictionary | None) -> Said:
    """Export everything that a node has by its EDS: the file records its state."""
    return lambda index, sub_index: dictionary is None or dictionary.entry(index, sub_index) is not None


def values_of(dictionary: ObjectDictionary) -> Said:
    """Export values in a DCF or XDC; nothing of an EDS."""

    def said(index: int, sub_index: int) -> bool:
        entry = dictionary.entry(index, sub_index)
        return entry is not None and entry.value is not None

    return said


def exported_objects(values: SdoReader, dictionary: ObjectDictionary | None, said: Said) -> Iterator[ObjectWish]:
    """Yield 0x1017 if present, and of the others those *said* or not at their usual value."""
    for key in OF[Where.NODE].values():
        if key.object is None:
            continue
        index, sub_index, size = key.object
        held = _held(values, index, sub_index, size)
        if held is None or _is_fixed(dictionary, index, sub_index):
            continue
        if held not in _USUAL.get(index, ()) or said(index, sub_index):
            yield ObjectWish(key.name, index, sub_index, held.to_bytes(size, "little"))


def exported_behaviours(values: SdoReader, dictionary: ObjectDictionary, said: Said) -> Iterator[ObjectWish]:
    """Yield the error behaviours (0x1029) that are *said*."""
    for entry in dictionary.entries():
        place = entry.index, entry.sub_index
        if place[0] == _BEHAVIOUR and place[1] and entry.access.writable and said(*place):
            held = _held(values, *place, 1)
            if held is not None:
                yield ObjectWish("error_behavior", *place, bytes([held]))


def exported_values(
    values: SdoReader,
    dictionary: ObjectDictionary | None,
    watches: Collection[HeartbeatWatch],
    node_id: int,
    said: Said,
) -> Iterator[tuple[ValueWish, str]]:
    """Yield EMCY, SYNC counter and entries of 0x1016 except *watches*, if *said*, with their meaning.

    They have no keys of their own. A default EMCY COB-ID of *node_id* follows the node-ID. Objects missing in the EDS
    are left out: they could not be checked without the node.
    """
    for (index, size), sense in _WITHOUT_KEY.items():
        held = _held(values, index, 0, size)
        if held is not None and said(index, 0) and not _is_fixed(dictionary, index, 0):
            is_own = index == _EMCY and held & _IDENTIFIER == _EMCY_BASE + node_id
            text = following(held - node_id) if is_own else f"0x{held:X}" if size == 4 else str(held)
            yield ValueWish(FileWord(f"{index:04X}:00"), FileWord(text)), sense
    left = {(watch.producer, watch.time_ms) for watch in watches}
    for sub_index, value in _slots(values).items():
        producer, time_ms = value >> 16 & 0xFF, value & 0xFFFF
        if (producer, time_ms) in left:
            left.remove((producer, time_ms))
        elif said(_CONSUMER, sub_index) and not _is_fixed(dictionary, _CONSUMER, sub_index):
            sense = "watches nobody" if not value else "as it was held"
            yield ValueWish(FileWord(f"{_CONSUMER:04X}:{sub_index:02X}"), FileWord(f"0x{value:X}")), sense


def _held(values: SdoReader, index: int, sub_index: int, size: int) -> int | None:
    """Return the value; None if absent or unreadable: not compared."""
    try:
        return read_optional(values, index, sub_index, size)
    except SdoAborted:
        return None


def _slots(values: SdoReader) -> dict[int, int]:
    try:
        return heartbeat_slots(values)
    except SdoAborted:
        return {}


def _is_fixed(dictionary: ObjectDictionary | None, index: int, sub_index: int) -> bool:
    described = dictionary.entry(index, sub_index) if dictionary else None
    return described is not None and not described.access.writable


def exported_watches(values: SdoReader) -> Iterator[HeartbeatWatch]:
    """Yield the used entries of 0x1016, one per producer, by node-ID."""
    found: dict[int, int] = {}
    for value in _slots(values).values():
        producer, time_ms = value >> 16 & 0xFF, value & 0xFFFF
        if time_ms and 1 <= producer <= 127:
            found.setdefault(producer, time_ms)
    yield from (HeartbeatWatch(producer, time_ms) for producer, time_ms in sorted(found.items()))
