"""Which objects of a device are configuration: what a file or a clone may write, and why nothing else.

Knows CiA 301, 302 and what a file and a profile say of an object. Does not know what an object holds, nor in which
state a device is: a power stage that is on forbids more.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from dvtcli.domain.acting_objects import (
    DEVICE_TYPE,
    DRIVE,
    PROFILES,
    Acts,
    DeviceTypes,
    acts,
    in_first,
    logical_types,
)
from dvtcli.domain.carried import pdo_may_carry, rpdo_may_take
from dvtcli.domain.named_process_data import is_named_as_process_data, is_named_as_setting
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import Range, within

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.profile import DeviceProfile, ObjectAddress


class NotWritten(StrEnum):
    """Why an object is not written for a file's or a clone's sake, in words that follow its name."""

    READ_ONLY = "is read-only"
    WRITE_ONLY = "is write-only: nobody could read back what was written"
    FLAGGED = "is not for a download (ObjFlags, bit 0)"
    ERROR_HISTORY = "is the error history"
    STORE = "stores or restores parameters: neither is done by writing values"
    STAMP = "is the stamp of a configuration: who configures sets it"
    PROGRAM = "belongs to program download, which goes by itself"
    SDO_CHANNEL = "is the SDO channel that is written over"
    SAFETY = "belongs to safety (EN 50325-5)"
    REQUEST = "is a request, which acts at once and keeps nothing"
    COMMAND = "is a command or a target"
    TAKEN = "is what an enabled RPDO takes: process data"
    OUTPUT = "is an output"
    PRESET = "sets what is measured now"
    PASSCODE = "is part of a login"
    NODE_ID = "is a node-ID or a bit rate: those change by LSS"
    BEHAVIOUR = "is asked or written by dvtcli for another purpose (the device's profile)"
    RPDO_MAPPABLE = "is what an RPDO can take: process data, or a setting"
    MAKERS_RPDO = "is the maker's own, and an RPDO can take it: nobody names it as configuration"
    NAMED_PROCESS_DATA = "is the maker's own, and a command, a target or a value by its name: a guess"
    NAMED_COMMAND = "is the maker's own, and a command by its name"
    MAKERS = "is the maker's own, and nobody names it as configuration"

    @property
    def is_lifted_by_include(self) -> bool:
        """Whether it may be written all the same where somebody names it himself; a command one by one."""
        return self in (
            NotWritten.MAKERS, NotWritten.MAKERS_RPDO, NotWritten.NAMED_COMMAND, NotWritten.NAMED_PROCESS_DATA,
            NotWritten.RPDO_MAPPABLE,
        )  # fmt: skip

    @property
    def may_be_setting(self) -> bool:
        """Whether it may be configuration all the same, which a comparison counts and a DCF of a node says."""
        return self.is_lifted_by_include and self is not NotWritten.NAMED_PROCESS_DATA


_ERROR_HISTORY, _STAMP = 0x1003, 0x1020
_STORE = (0x1010, 0x1011)
_PROGRAM = range(0x1F50, 0x1F60)
_DEFAULT_SDO_SERVER = 0x1200
_SAFETY = range(0x1300, 0x1400)
#: time stamp, stored EDS, operating system (CiA 301, 7.5.2.20 to 7.5.2.29), node-ID of old standards,
#: and of CiA 302: verify and configure, request NMT, request guarding
_REQUESTS = frozenset({0x1013, 0x1021, 0x1022, 0x1023, 0x1024, 0x1025, 0x1026, 0x1F24, 0x1F25, 0x1F82, 0x1F83})
_NODE_ID = 0x100B
_MAKERS = range(0x2000, 0x6000)
#: Where the objects of CiA 402 are, in the first axis: what is no command there is a setting
_OF_DRIVES = range(0x6040, 0x6100)
_ACTS = {Acts.COMMAND: NotWritten.COMMAND, Acts.OUTPUT: NotWritten.OUTPUT, Acts.PRESET: NotWritten.PRESET}
_DOWNLOAD_REFUSED = 0x01
_NAMED_PASSCODE = re.compile(r"pass_?(code|word|wort|phrase)|password|kennwort|access_code|security_(code|key)|unlock")
_NAMED_NODE_ID = re.compile(r"node_?(id|address|number)|module_(id|address)|can_address|bit_?rate|baud_?rate")
#: words of a command, wherever they stand in a name, unless a word of `_NAMED_SETTING` stands there, too
_NAMED_COMMAND = re.compile(
    r"(?<![a-z])((soft|hard|power)?_?re_?set|re_?boot|factory|boot_?loader|erase|calibrate|self_?test|auto_?tune|teach|acknowledge|brake_release"
    r"|(save|store|restore|load|reload)_(all|defaults?|param(eter)?s?|settings?|config(uration)?|now|to_\w+|from_\w+)"
    r"|(start|stop|run|do|perform|begin|execute|trigger)_(self|auto|test|calibration|homing|teach|tuning|identification)"
    r"|(homing|calibration|jog)_(start|stop|run)|firmware_update|format_(flash|memory|disk|card|eeprom|file_?system))(?![a-z])"
)
#: the whole name of a command, with or without what it is done to
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
    """Whether a maker's object is a command by its *name*, or by its *whole* one with its record's, as `normalised`.

    `Factory reset` and `Jog` are, `Fault reset input`, `Homing speed` and `Filter enable` are settings.
    """
    if _NAMED_SETTING.search(whole):
        return False
    return bool(_WHOLE_COMMAND.fullmatch(name) or _NAMED_COMMAND.search(whole))


@dataclass(frozen=True, slots=True)
class Configuration:
    """Which of a device's objects may be written from a file, by its *profile*.

    *types* are the device profiles that it says it has. *named* are objects of the maker that a file names as
    configuration, *included* ranges of indices that the user names, *included_objects* single sub-indices
    that he names, *taken* objects that an RPDO takes now. *dictionary* has the names of whole objects.
    """

    profile: DeviceProfile
    types: DeviceTypes = field(default_factory=DeviceTypes)
    named: Collection[ObjectAddress] = field(default_factory=frozenset)
    included: Collection[Range] = ()
    included_objects: Collection[ObjectAddress] = ()
    taken: Collection[ObjectAddress] = field(default_factory=frozenset)
    dictionary: ObjectDictionary | None = None

    def why_not(self, entry: OdEntry) -> NotWritten | None:
        """Why the object that *entry* describes is not written; None where it is configuration."""
        found = self._never(entry)
        if found is not None or Pdo.at(entry.index) is not None:
            return found
        if entry.index in _MAKERS:
            found = self._of_maker(entry)
        elif rpdo_may_take(entry):
            found = NotWritten.RPDO_MAPPABLE
        return None if found is not None and found.is_lifted_by_include and self._is_included(entry, found) else found

    def _never(self, entry: OdEntry) -> NotWritten | None:
        """Why nobody writes it, named or not."""
        if (entry.index, entry.sub_index) in self.taken:
            return NotWritten.TAKEN
        return _by_standard(entry.index) or self._by_profiles(entry) or _by_access(entry) or self._by_name(entry)

    def _by_profiles(self, entry: OdEntry) -> NotWritten | None:
        """What the device's own profile, and the device profile that it says it has, know of it."""
        place, own = (entry.index, entry.sub_index), self.profile
        if own.login is not None and place in (own.login.level, own.login.passcode, own.login.user_id):
            return NotWritten.PASSCODE
        if within(entry.index, own.no_configuration) or place in _behaviours(own):
            return NotWritten.BEHAVIOUR
        acting = acts(entry, self._names(entry), self.types)
        return None if acting is None else _ACTS[acting]

    def _by_name(self, entry: OdEntry) -> NotWritten | None:
        """What the name tells of an object that no standard describes."""
        if entry.index not in _MAKERS:
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
        """The same where the user names nothing."""
        return replace(self, included=(), included_objects=())

    def _is_included(self, entry: OdEntry, why: NotWritten) -> bool:
        """Whether the user names it or its index; a range is enough only for what is no process data for sure."""
        if (entry.index, entry.sub_index) in self.included_objects or (entry.index, entry.index) in self.included:
            return True
        is_sure = why is NotWritten.MAKERS or (
            why in (NotWritten.MAKERS_RPDO, NotWritten.RPDO_MAPPABLE) and self._is_setting(entry)
        )
        return is_sure and within(entry.index, self.included)

    def _is_setting(self, entry: OdEntry) -> bool:
        """Whether what an RPDO could take is a setting by its standard or its own name, which a range may write."""
        in_drive = entry.index in PROFILES and in_first(entry.index) in _OF_DRIVES
        if entry.index < _MAKERS.start or (in_drive and self.types.at(entry.index) & {0, DRIVE}):
            return True
        whole = None if self.dictionary is None else self.dictionary.get(entry.index)
        return is_named_as_setting(entry.name, "" if whole is None else whole.name)

    def _full_name(self, entry: OdEntry) -> str:
        """Its own name and the one with its object's, as `normalised`."""
        return normalised(self._names(entry))

    def _names(self, entry: OdEntry) -> str:
        whole = "" if self.dictionary is None else self.dictionary.display_name(entry.index, entry.sub_index)
        return f"{entry.name} {whole}"


_ONE_BY_ONE = {
    _ERROR_HISTORY: NotWritten.ERROR_HISTORY,
    _STAMP: NotWritten.STAMP,
    _DEFAULT_SDO_SERVER: NotWritten.SDO_CHANNEL,
    _NODE_ID: NotWritten.NODE_ID,
    **dict.fromkeys(_STORE, NotWritten.STORE),
    **dict.fromkeys(_REQUESTS, NotWritten.REQUEST),
}


def configuration_of(
    dictionary: ObjectDictionary, profile: DeviceProfile, included: Collection[Range] = ()
) -> Configuration:
    """What is configuration of a device that *dictionary* describes; *included* are ranges that the user names."""
    return Configuration(profile, device_types(dictionary), included=included, dictionary=dictionary)


def device_types(dictionary: ObjectDictionary, held: Callable[[int], bytes | None] | None = None) -> DeviceTypes:
    """The device profiles that *dictionary* tells, and the node itself: *held* is what it holds at an index."""

    def told(index: int) -> list[bytes]:
        entry = dictionary.entry(index, 0)
        both = (None if entry is None else entry.initial(0), None if held is None else held(index))
        return [data for data in both if data is not None]

    types = told(DEVICE_TYPE)
    is_several = DeviceTypes.of(*types).is_several
    places = {device: index for device, index in logical_types().items() if is_several or index in dictionary}
    return DeviceTypes.of(*types, logical={device: found[-1] for device, at in places.items() if (found := told(at))})


def _by_standard(index: int) -> NotWritten | None:
    found = _ONE_BY_ONE.get(index)
    if found is not None:
        return found
    if index in _PROGRAM:
        return NotWritten.PROGRAM
    return NotWritten.SAFETY if index in _SAFETY else None


def _by_access(entry: OdEntry) -> NotWritten | None:
    if not entry.access.writable:
        return NotWritten.READ_ONLY
    if entry.object_flags & _DOWNLOAD_REFUSED:
        return NotWritten.FLAGGED
    return NotWritten.WRITE_ONLY if not entry.access.readable else None


def _behaviours(profile: DeviceProfile) -> set[ObjectAddress | None]:
    """Objects by which the family does something: states, lists of errors, how it saves."""
    faults = profile.fault_list
    asked = (profile.state_object, profile.state_request, profile.master_object, profile.extended_error)
    return {*asked, profile.store.saved_by, *(() if faults is None else (faults.count, faults.position, faults.code))}
