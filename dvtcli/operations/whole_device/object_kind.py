"""What kind of object one is, by its description: a setting, a word about the device, or neither. Reads no device."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from dvtcli.domain.configuration import Configuration, NotWritten
from dvtcli.domain.object_dictionary import Access, OdEntry
from dvtcli.domain.pdo import BY_SUB_INDEX, Pdo
from dvtcli.domain.standard_objects import standard_entry

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import ObjectAddress

_COMMUNICATION, _STATES = range(0x1000, 0x2000), (0x1001, 0x1002)


class DifferenceKind(Enum):
    """What a difference between two values of an object means."""

    SETTING = "it is configured otherwise"
    ABOUT = "it is another device, or another program"
    APART = "it commands, measures, or changes by itself"


def entry_of(dictionary: ObjectDictionary | None, place: ObjectAddress) -> OdEntry:
    """How the object at *place* is described: by *dictionary*, else by the standard, else not at all."""
    entry = None if dictionary is None else dictionary.entry(*place)
    if entry is not None:
        return entry
    standard = standard_entry(*place)
    if standard is None:
        return OdEntry(*place, "")
    return OdEntry(*place, "", standard.data_type, standard.access or Access.RW)


def is_setting(why: NotWritten | None) -> bool:
    """Whether an object that is not written for this reason (None: it is) is configured all the same, by somebody."""
    return why is None or why.may_be_setting or why in (NotWritten.FLAGGED, NotWritten.SAFETY)


def kind_of(known: Configuration, entry: OdEntry) -> DifferenceKind:
    """What a difference of the object that *entry* describes means; what a PDO is set to counts, fixed or not."""
    if (pdo := Pdo.at(entry.index)) is not None:
        is_parameter = entry.index == pdo.mapping_index or entry.sub_index in BY_SUB_INDEX
        return DifferenceKind.SETTING if is_parameter else DifferenceKind.APART
    why = known.why_not(entry)
    if is_setting(why):
        return DifferenceKind.SETTING
    if why is not NotWritten.READ_ONLY or entry.index in _STATES:
        return DifferenceKind.APART
    return (
        DifferenceKind.ABOUT if entry.index in _COMMUNICATION or entry.access is Access.CONST else DifferenceKind.APART
    )
