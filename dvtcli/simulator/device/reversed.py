"""A strict device with reversed fields in mapping entries on the wire: length, sub-index, index."""

from __future__ import annotations

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.memory import Backing
from dvtcli.simulator.device.strict_device import StrictDevice

_MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))


class ReversedDevice(StrictDevice):
    """A device, or a twin, with mapping entries in its own order; see `StrictDevice`."""

    def __init__(
        self, dictionary: ObjectDictionary, family: Family, node_id: int, *, backing: Backing | None = None
    ) -> None:
        def turned(index: int, sub_index: int) -> bytes:
            assert backing is not None  # noqa: S101 - called only where there is one
            data = backing(index, sub_index)
            return _inward(data) if _is_entry(index, sub_index, data) else data

        super().__init__(dictionary, family, node_id, backing=None if backing is None else turned)

    def upload(self, index: int, sub_index: int) -> bytes:
        """The value of an SDO upload."""
        data = super().upload(index, sub_index)
        return _outward(data) if _is_entry(index, sub_index, data) else data

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        """Write *data* as an SDO download does."""
        super().download(index, sub_index, _inward(data) if _is_entry(index, sub_index, data) else data)


def _is_entry(index: int, sub_index: int, data: bytes) -> bool:
    return sub_index > 0 and len(data) == 4 and any(index in mappings for mappings in _MAPPINGS)


def _inward(data: bytes) -> bytes:
    """0x20006064, as on the wire, is 0x60640020."""
    raw = int.from_bytes(data, "little")
    return ((raw & 0xFFFF) << 16 | (raw >> 16 & 0xFF) << 8 | raw >> 24).to_bytes(4, "little")


def _outward(data: bytes) -> bytes:
    """0x60640020 is 0x20006064 on the wire."""
    raw = int.from_bytes(data, "little")
    return (raw >> 16 | (raw >> 8 & 0xFF) << 16 | (raw & 0xFF) << 24).to_bytes(4, "little")
