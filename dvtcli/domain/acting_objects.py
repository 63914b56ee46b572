"""Which objects of device profiles act at once when they are written: outputs, commands and targets, presets.

Knows CiA 401, 402, 404, 406 and 410, and how a device tells its profiles (CiA 301, 7.5.2.1). Does not know a maker's
own objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import TYPE_CHECKING

from dvtcli.domain.carried import rpdo_may_take
from dvtcli.domain.named_process_data import is_named_as_process_data

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import OdEntry

DEVICE_TYPE = 0x1000
#: Where the objects of device profiles are
PROFILES = range(0x6000, 0xA000)
DRIVE = 402
_IO_MODULE, _MEASURING, _ENCODER, _INCLINOMETER = 401, 404, 406, 410
#: How far the objects of one axis, or logical device, are from those of the next (CiA 301, 7.4.1)
_LOGICAL_DEVICE = 0x800
_LAST_OF_FIRST = 0x67FF
#: the upper half of 0x1000 where there are several logical devices
_SEVERAL = 0xFFFF
#: CiA 401: digital outputs of 8, 1, 16 and 32 bits, analogue ones of 8, 16, 32 bits, a float and of a maker's kind
_OUTPUTS = frozenset({0x6200, *range(0x6220, 0x6228), 0x6300, 0x6320, *range(0x6410, 0x6415)})
#: CiA 402: controlword, targets, offsets, touch probe, interpolation data, outputs
_COMMANDS = frozenset(
    {0x6040, 0x6042, 0x6052, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60B8, 0x60C1, 0x60FE, 0x60FF}
)  # fmt: skip
#: auto zero (CiA 404), preset (CiA 406), preset of a slope (CiA 410): written, what is measured is another value
_PRESETS: Mapping[int, frozenset[int]] = {
    _MEASURING: frozenset({0x6125, 0x7124, 0x9124}),
    _ENCODER: frozenset({0x6003, 0x6010, 0x6013}),
    _INCLINOMETER: frozenset({0x6012, 0x6022, 0x6112, 0x6122}),
}
#: what a profile says is a setting, where another one has an output: the cyclic timer of an encoder
_SETTINGS: Mapping[int, frozenset[int]] = {_ENCODER: frozenset({0x6200})}


class Acts(Enum):
    """What an object of a device profile does at once when it is written."""

    COMMAND = auto()
    OUTPUT = auto()
    PRESET = auto()


@dataclass(frozen=True, slots=True)
class DeviceTypes:
    """The device profiles that a device says it has.

    *said* are the numbers that its 0x1000 tells (`401`), by the node and by its file; 0 alone where there is none, or
    nobody knows. With *is_several* it has logical devices; *logical* are the numbers of those, from 0, whose own
    type is known.
    """

    said: frozenset[int] = frozenset({0})
    is_several: bool = False
    logical: Mapping[int, int] = field(default_factory=dict)

    @classmethod
    def of(cls, *types: bytes, logical: Mapping[int, bytes] | None = None) -> DeviceTypes:
        """As *types*, values of 0x1000, and those of *logical* devices tell it."""
        numbers = frozenset(int.from_bytes(device_type[:2], "little") for device_type in types)
        is_several = any(int.from_bytes(device_type[2:4], "little") == _SEVERAL for device_type in types)
        own = {device: int.from_bytes(one[:2], "little") for device, one in (logical or {}).items()}
        return cls(numbers - {0} or frozenset({0}), is_several, own)

    def at(self, index: int) -> frozenset[int]:
        """The numbers by which the object at *index* of `PROFILES` may be meant; 0 among them: any."""
        device = (index - PROFILES.start) // _LOGICAL_DEVICE
        if device in self.logical:
            return self.said | {self.logical[device]}
        return self.said | {0} if self.is_several and device else self.said


def logical_types() -> Mapping[int, int]:
    """Where each logical device, from 0, tells its own device type (CiA 301, 7.5.2.1)."""
    devices = range(len(PROFILES) // _LOGICAL_DEVICE)
    return {device: _LAST_OF_FIRST + device * _LOGICAL_DEVICE for device in devices}


def in_first(index: int) -> int:
    """The index that *index* of `PROFILES` has in the first logical device."""
    return PROFILES.start + (index - PROFILES.start) % _LOGICAL_DEVICE


def acts(entry: OdEntry, names: str, types: DeviceTypes) -> Acts | None:
    """What writing *entry*, which is called *names*, does at once on a device of *types*; None for nothing.

    Makers have drives with outputs, and I/O modules with drives: what is at an output's or a command's index acts on a
    device of any profile, unless that profile says otherwise, or no RPDO can take it and its name says nothing of it.
    """
    if entry.index not in PROFILES:
        return None
    first, numbers = in_first(entry.index), types.at(entry.index)
    for number, places, found in ((DRIVE, _COMMANDS, Acts.COMMAND), (_IO_MODULE, _OUTPUTS, Acts.OUTPUT)):
        if first not in places:
            continue
        if numbers & {0, number} or (_may_be_process_data(entry, names) and not _is_setting(first, numbers)):
            return found
    return Acts.PRESET if any(first in _PRESETS.get(number, ()) for number in numbers) else None


def _is_setting(first: int, numbers: frozenset[int]) -> bool:
    return all(first in _SETTINGS.get(number, ()) for number in numbers)


def _may_be_process_data(entry: OdEntry, names: str) -> bool:
    """Whether an RPDO can take *entry*, or nobody says that none can; or its name is an output's or a command's."""
    unknown = entry.pdo_mapping is None
    return entry.access.writable and (unknown or rpdo_may_take(entry) or is_named_as_process_data(names))
