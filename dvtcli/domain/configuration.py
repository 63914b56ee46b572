"""Configuration objects, which a file or a clone may write, and the reasons why others are not written."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum, auto
from typing import TYPE_CHECKING

from dvtcli.domain.object_dictionary import Access, normalised
from dvtcli.domain.objects import (
    DEVICE_TYPE,
    ERROR_FIELD,
    LOGICAL_DEVICE,
    MANUFACTURER_AREA,
    PROFILE_AREA,
    RESTORE_PARAMETERS,
    SAFETY,
    STORE_PARAMETERS,
    VERIFY_CONFIGURATION,
    in_first,
)
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.process_data import is_named_as_process_data, is_named_as_setting, pdo_may_carry, rpdo_may_take
from dvtcli.domain.profile import Range, within

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.profile import DeviceProfile, ObjectAddress

DRIVE = 402
_IO_MODULE, _MEASURING, _ENCODER, _INCLINOMETER = 401, 404, 406, 410
_LAST_OF_FIRST = 0x67FF
#: the upper half of 0x1000 if the device has several logical devices
_SEVERAL = 0xFFFF
#: CiA 401: digital outputs of 8, 1, 16 and 32 bits, analogue outputs of 8, 16, 32 bits, float and manufacturer-specific
_OUTPUTS = frozenset({0x6200, *range(0x6220, 0x6228), 0x6300, 0x6320, *range(0x6410, 0x6415)})
#: CiA 402: controlword, targets, offsets, touch probe, interpolation data, outputs
_COMMANDS = frozenset(
    {0x6040, 0x6042, 0x6052, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60B8, 0x60C1, 0x60FE, 0x60FF}
)  # fmt: skip
#: auto zero (CiA 404), preset (CiA 406), preset of a slope (CiA 410): a write changes the measured value
_PRESETS: Mapping[int, frozenset[int]] = {
    _MEASURING: frozenset({0x6125, 0x7124, 0x9124}),
    _ENCODER: frozenset({0x6003, 0x6010, 0x6013}),
    _INCLINOMETER: frozenset({0x6012, 0x6022, 0x6112, 0x6122}),
}
#: settings in one profile at an output's index in another: the cyclic timer of an encoder
_SETTINGS: Mapping[int, frozenset[int]] = {_ENCODER: frozenset({0x6200})}


class Acts(Enum):
    """Immediate effect when a device profile's object is written."""

    COMMAND = auto()
    OUTPUT = auto()
    PRESET = auto()


@dataclass(frozen=True, slots=True)
class DeviceTypes:
    """Device profiles that a device claims.

    *said* are the profile numbers in 0x1000 (`401`) according to node and file; only 0 for none or unknown.
    *is_several*: the device has logical devices; *logical* are their profile numbers if known, by number from 0.
    """

    said: frozenset[int] = frozenset({0})
    is_several: bool = False
    logical: Mapping[int, int] = field(default_factory=dict)

    @classmethod
    def of(cls, *types: bytes, logical: Mapping[int, bytes] | None = None) -> DeviceTypes:
        """Device profiles from *types*, values of 0x1000, and from *logical* devices' types."""
        numbers = frozenset(int.from_bytes(device_type[:2], "little") for device_type in types)
        is_several = any(int.from_bytes(device_type[2:4], "little") == _SEVERAL for device_type in types)
        own = {device: int.from_bytes(one[:2], "little") for device, one in (logical or {}).items()}
        return cls(numbers - {0} or frozenset({0}), is_several, own)

    def at(self, index: int) -> frozenset[int]:
        """Profile numbers that may define the object at *index* in `PROFILE_AREA`; 0 means any profile."""
        device = (index - PROFILE_AREA.start) // LOGICAL_DEVICE
        if device in self.logical:
            return self.said | {self.logical[device]}
        return self.said | {0} if self.is_several and device else self.said


def logical_types() -> Mapping[int, int]:
    """Index of each logical device's type, by number from 0 (CiA 301, 7.5.2.1)."""
    devices = range(len(PROFILE_AREA) // LOGICAL_DEVICE)
    return {device: _LAST_OF_FIRST + device * LOGICAL_DEVICE for device in devices}


def acts(entry: OdEntry, names: str, types: DeviceTypes) -> Acts | None:
    """Immediate effect when *entry*, named *names*, is written on a device with *types*; None for no effect.

    Makers have drives with outputs, and I/O modules with drives: an object at an output's or a command's index acts on
    any device, unless the device's profile says otherwise, or no RPDO can write it and its name does not suggest
    process data.
    """
    if entry.index not in PROFILE_AREA:
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
    """Whether an RPDO can write *entry* or its mapping flag is unknown; or its name is an output's or a command's."""
    unknown = entry.pdo_mapping is None
    return entry.access.writable and (unknown or rpdo_may_take(entry) or is_named_as_process_data(names))


_STORE = (STORE_PARAMETERS, RESTORE_PARAMETERS)
_PROGRAM = range(0x1F50, 0x1F60)
_DEFAULT_SDO_SERVER = 0x1200
#: time stamp, stored EDS, operating system (CiA 301, 7.5.2.16 and 7.5.2.24 to 7.5.2.29), node-ID of old standards,
#: and of CiA 302: verify and configure, request NMT, request guarding
_REQUESTS = frozenset({0x1013, 0x1021, 0x1022, 0x1023, 0x1024, 0x1025, 0x1026, 0x1F24, 0x1F25, 0x1F82, 0x1F83})
_NODE_ID = 0x100B
#: Indices of CiA 402 in the first axis: an object other than a command is a setting
_OF_DRIVES = range(0x6040, 0x6100)


class NotWritten(StrEnum):
    """Reason why a file or a clone does not write an object, in words that follow the object's name."""

    READ_ONLY = "is read-only"
    WRITE_ONLY = "is write-only: it cannot be read back"
    FLAGGED = "is not for a download (ObjFlags, bit 0)"
    ERROR_HISTORY = "is the error history"
    STORE = "stores or restores parameters: neither is done by writing values"
    STAMP = "is the stamp of a configuration"
    PROGRAM = "belongs to program download, which has its own command"
    SDO_CHANNEL = "is the SDO channel that is written over"
    SAFETY = "belongs to safety (EN 50325-5)"
    REQUEST = "is a command that acts at once and is not stored"
    COMMAND = "is a command or a target"
    TAKEN = "is written by an enabled RPDO: process data"
    OUTPUT = "is an output"
    PRESET = "sets a measured value"
    PASSCODE = "is part of a login"
    NODE_ID = "is a node-ID or a bit rate: LSS changes these"
    BEHAVIOUR = "is asked or written by dvtcli for another purpose (the device's profile)"
    RPDO_MAPPABLE = "can be mapped to an RPDO: process data, or a setting"
    MAKERS_RPDO = "is manufacturer-specific, and can be mapped to an RPDO: no profile defines it as configuration"
    NAMED_PROCESS_DATA = "is manufacturer-specific, and by its name a command, a target or a process value (a guess)"
    NAMED_COMMAND = "is manufacturer-specific, and by its name a command"
    MAKERS = "is manufacturer-specific, and no profile defines it as configuration"

    @property
    def is_lifted_by_include(self) -> bool:
        """Whether the user can include the object by naming it; a command only by its own address."""
        return self in (
            NotWritten.MAKERS, NotWritten.MAKERS_RPDO, NotWritten.NAMED_COMMAND, NotWritten.NAMED_PROCESS_DATA,
            NotWritten.RPDO_MAPPABLE,
        )  # fmt: skip

    @property
    def may_be_setting(self) -> bool:
        """Whether the object may be configuration after all: comparisons count it and a node's DCF contains it."""
        return self.is_lifted_by_include and self is not NotWritten.NAMED_PROCESS_DATA


_ACTS = {Acts.COMMAND: NotWritten.COMMAND, Acts.OUTPUT: NotWritten.OUTPUT, Acts.PRESET: NotWritten.PRESET}
_DOWNLOAD_REFUSED = 0x01
_NAMED_PASSCODE = re.compile(r"pass_?(code|word|wort|phrase)|password|kennwort|access_code|security_(code|key)|unlock")
_NAMED_NODE_ID = re.compile(r"node_?(id|address|number)|module_(id|address)|can_address|bit_?rate|baud_?rate")
#: words of a command anywhere in a name, unless the name has a word of `_NAMED_SETTING`
_NAMED_COMMAND = re.compile(
    r"(?<![a-z])((soft|hard|power)?_?re_?set|re_?boot|factory|boot_?loader|erase|calibrate|self_?test|auto_?tune|teach|acknowledge|brake_release"
    r"|(save|store|restore|load|reload)_(all|defaults?|param(eter)?s?|settings?|config(uration)?|now|to_\w+|from_\w+)"
    r"|(start|stop|run|do|perform|begin|execute|trigger)_(self|auto|test|calibration|homing|teach|tuning|identification)"
    r"|(homing|calibration|jog)_(start|stop|run)|firmware_update|format_(flash|memory|disk|card|eeprom|file_?system))(?![a-z])"
)
#: the whole name of a command, with or without its object
_WHOLE_COMMAND = re.compile(
    r"(start|stop|enable|disable|re_?start|jog|homing|home|calibration|format|save|store|restore|defaults?|command|execute"
    r"|trigger|release|clear|un_?lock)"
    r"(_(drive|motor|axis|motion|movement|device|power(_stage)?|brake|plus|minus|positive|negative|forward|backward"
    r"|reverse|now|errors?|faults?|alarms?|history|memory|flash|all|parameters?))?(_?\d+)?"
)
_NAMED_SETTING = re.compile(
    r"(?<![a-z])(speed|velocity|acceleration|deceleration|ramp|jerk|timer?|timeout|delay|interval|period|duration|limit|level"
    r"|threshold|current|voltage|torque|frequency|angle|position|offset|mode|method|type|mask|gain|factor|value|percent"
    r"|percentage|temperature|polarity|source|input|output|pin|switch|address|window|distance|direction|filter|bit)s?(?![a-z])"
)


def is_named_as_command(name: str, whole: str) -> bool:
    """Whether the *name* of a manufacturer's object, or *whole* with its record's, is a command, as `normalised`.

    `Factory reset` and `Jog` are, `Fault reset input`, `Homing speed` and `Filter enable` are settings.
    """
    if _NAMED_SETTING.search(whole):
        return False
    return bool(_WHOLE_COMMAND.fullmatch(name) or _NAMED_COMMAND.search(whole))


@dataclass(frozen=True, slots=True)
class Configuration:
    """Objects that a file may write, according to the device's *profile*.

    *types* are the device profiles that the device claims. *named* are manufacturer-specific objects named in a file
    as configuration, *included* the user's ranges of indices, *included_objects* the user's single sub-indices,
    *taken* objects mapped in an RPDO now. *dictionary* has the names of whole objects.
    """

    profile: DeviceProfile
    types: DeviceTypes = field(default_factory=DeviceTypes)
    named: Collection[ObjectAddress] = field(default_factory=frozenset)
    included: Collection[Range] = ()
    included_objects: Collection[ObjectAddress] = ()
    taken: Collection[ObjectAddress] = field(default_factory=frozenset)
    dictionary: ObjectDictionary | None = None

    def why_not(self, entry: OdEntry) -> NotWritten | None:
        """Why the object *entry* is not written; None if it is configuration."""
        found = self._never(entry)
        if found is not None or Pdo.at(entry.index) is not None:
            return found
        if entry.index in MANUFACTURER_AREA:
            found = self._of_maker(entry)
        elif rpdo_may_take(entry):
            found = NotWritten.RPDO_MAPPABLE
        return None if found is not None and found.is_lifted_by_include and self._is_included(entry, found) else found

    def why_not_unread(self, entry: OdEntry) -> NotWritten | None:
        """Why *entry* is not written by who reads no write-only object back; None if it is configuration."""
        found = self.why_not(entry)
        return self.why_not(replace(entry, access=Access.RW)) if found is NotWritten.WRITE_ONLY else found

    def _never(self, entry: OdEntry) -> NotWritten | None:
        """Why the object must not be written, even if the user names it."""
        if (entry.index, entry.sub_index) in self.taken:
            return NotWritten.TAKEN
        return _by_standard(entry.index) or self._by_profiles(entry) or _by_access(entry) or self._by_name(entry)

    def _by_profiles(self, entry: OdEntry) -> NotWritten | None:
        """Reasons from the device's own profile and its claimed device profile."""
        place, own = (entry.index, entry.sub_index), self.profile
        if own.login is not None and place in (own.login.level, own.login.passcode, own.login.user_id):
            return NotWritten.PASSCODE
        if within(entry.index, own.no_configuration) or place in _behaviours(own):
            return NotWritten.BEHAVIOUR
        acting = acts(entry, self._names(entry), self.types)
        return None if acting is None else _ACTS[acting]

    def _by_name(self, entry: OdEntry) -> NotWritten | None:
        """Reasons from the name of an object outside the standards."""
        if entry.index not in MANUFACTURER_AREA:
            return None
        name = self._full_name(entry)
        if _NAMED_PASSCODE.search(name):
            return NotWritten.PASSCODE
        return NotWritten.NODE_ID if _NAMED_NODE_ID.search(name) else None

    def _of_maker(self, entry: OdEntry) -> NotWritten | None:
        is_command = is_named_as_command(normalised(entry.name), self._full_name(entry))
        if pdo_may_carry(entry) and (is_command or is_named_as_process_data(self._names(entry))):
            return NotWritten.NAMED_PROCESS_DATA
        if rpdo_may_take(entry):  # a current limit or a gain, too: makers let RPDOs take much
            return NotWritten.MAKERS_RPDO
        pins = {group.index for group in self.profile.vpdo.values()}
        if entry.index in pins or within(entry.index, self.profile.configuration):
            return None
        if is_command:
            return NotWritten.NAMED_COMMAND
        return None if (entry.index, entry.sub_index) in self.named else NotWritten.MAKERS

    def without_included(self) -> Configuration:
        """The same configuration without the user's includes."""
        return replace(self, included=(), included_objects=())

    def _is_included(self, entry: OdEntry, why: NotWritten) -> bool:
        """Whether the user names the object or its index; a range includes only objects that are surely no process
        data.
        """
        if (entry.index, entry.sub_index) in self.included_objects or (entry.index, entry.index) in self.included:
            return True
        is_sure = why is NotWritten.MAKERS or (
            why in (NotWritten.MAKERS_RPDO, NotWritten.RPDO_MAPPABLE) and self._is_setting(entry)
        )
        return is_sure and within(entry.index, self.included)

    def _is_setting(self, entry: OdEntry) -> bool:
        """Whether an RPDO-mappable object is a setting by standard or name; a range may write a setting."""
        in_drive = entry.index in PROFILE_AREA and in_first(entry.index) in _OF_DRIVES
        if entry.index < MANUFACTURER_AREA.start or (in_drive and self.types.at(entry.index) & {0, DRIVE}):
            return True
        whole = None if self.dictionary is None else self.dictionary.get(entry.index)
        return is_named_as_setting(entry.name, "" if whole is None else whole.name)

    def _full_name(self, entry: OdEntry) -> str:
        """The entry's own name and its name with the object's, as `normalised`."""
        return normalised(self._names(entry))

    def _names(self, entry: OdEntry) -> str:
        whole = "" if self.dictionary is None else self.dictionary.display_name(entry.index, entry.sub_index)
        return f"{entry.name} {whole}"


_ONE_BY_ONE = {
    ERROR_FIELD: NotWritten.ERROR_HISTORY,
    VERIFY_CONFIGURATION: NotWritten.STAMP,
    _DEFAULT_SDO_SERVER: NotWritten.SDO_CHANNEL,
    _NODE_ID: NotWritten.NODE_ID,
    **dict.fromkeys(_STORE, NotWritten.STORE),
    **dict.fromkeys(_REQUESTS, NotWritten.REQUEST),
}


def configuration_of(
    dictionary: ObjectDictionary, profile: DeviceProfile, included: Collection[Range] = ()
) -> Configuration:
    """Configuration of a device with *dictionary*; *included* are the user's ranges of indices."""
    return Configuration(profile, device_types(dictionary), included=included, dictionary=dictionary)


def device_types(dictionary: ObjectDictionary, held: Callable[[int], bytes | None] | None = None) -> DeviceTypes:
    """Device profiles according to *dictionary* and to the node itself: *held* returns the node's value at an index."""

    def contents(index: int) -> list[bytes]:
        entry = dictionary.entry(index, 0)
        both = (None if entry is None else entry.initial(0), None if held is None else held(index))
        return [data for data in both if data is not None]

    types = contents(DEVICE_TYPE)
    is_several = DeviceTypes.of(*types).is_several
    places = {device: index for device, index in logical_types().items() if is_several or index in dictionary}
    return DeviceTypes.of(
        *types, logical={device: found[-1] for device, at in places.items() if (found := contents(at))}
    )


def _by_standard(index: int) -> NotWritten | None:
    found = _ONE_BY_ONE.get(index)
    if found is not None:
        return found
    if index in _PROGRAM:
        return NotWritten.PROGRAM
    return NotWritten.SAFETY if index in SAFETY else None


def _by_access(entry: OdEntry) -> NotWritten | None:
    if not entry.access.writable:
        return NotWritten.READ_ONLY
    if entry.object_flags & _DOWNLOAD_REFUSED:
        return NotWritten.FLAGGED
    return NotWritten.WRITE_ONLY if not entry.access.readable else None


def _behaviours(profile: DeviceProfile) -> set[ObjectAddress | None]:
    """Objects through which the family acts: states, error lists, saving."""
    faults = profile.fault_list
    asked = (profile.state_object, profile.state_request, profile.master_object, profile.extended_error)
    return {*asked, profile.store.saved_by, *(() if faults is None else (faults.count, faults.position, faults.code))}
