"""What a node does with heartbeats, guarding, SYNC and the time stamp, as keys of a network file. Writes nothing.

Does not know PDOs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.device.heartbeat_slots import heartbeat_slots
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.network.wanted_state import HeartbeatWatch, ObjectWish
from dvtcli.errors import SdoAborted
from dvtcli.files.network.network_keys import OF, Where

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.ports import SdoReader

#: what objects hold where nobody set them (CiA 301, 7.5.2.5 to 7.5.2.15), and a file need not say
_USUAL = {0x1005: (0x80, 0x8000_0080), 0x1006: (0,), 0x100C: (0,), 0x100D: (0,), 0x1012: (0x100, 0x8000_0100)}


def exported_objects(values: SdoReader, dictionary: ObjectDictionary | None) -> Iterator[ObjectWish]:
    """0x1017 where the node has it, and those of the others that hold something else than they usually do."""
    for key in OF[Where.NODE].values():
        if key.object is None:
            continue
        index, sub_index, size = key.object
        try:
            held = read_optional(values, index, sub_index, size)
        except SdoAborted:
            continue  # what cannot be read is not compared either
        described = dictionary.entry(index, sub_index) if dictionary else None
        fixed = described is not None and not described.access.writable
        if held is not None and held not in _USUAL.get(index, ()) and not fixed:
            yield ObjectWish(key.name, index, sub_index, held.to_bytes(size, "little"))


def exported_watches(values: SdoReader) -> Iterator[HeartbeatWatch]:
    """The entries of 0x1016 that are in use, one a producer, in order of node-ID."""
    try:
        slots = heartbeat_slots(values)
    except SdoAborted:
        return
    found: dict[int, int] = {}
    for value in slots.values():
        producer, time_ms = value >> 16 & 0xFF, value & 0xFFFF
        if time_ms and 1 <= producer <= 127:
            found.setdefault(producer, time_ms)
    yield from (HeartbeatWatch(producer, time_ms) for producer, time_ms in sorted(found.items()))
