"""Rules about the shape of objects: sub-index 0, arrays, names, flags. Does not know what an object is for."""

from __future__ import annotations

from collections import Counter

from dvtcli.domain.datatypes import U8
from dvtcli.domain.lint.described import OF_MANY, DescribedDevice, Found, Spot, at
from dvtcli.domain.lint.lint_rule import NOTE, WARNING, check
from dvtcli.domain.object_dictionary import ObjectType, OdObject, normalised
from dvtcli.domain.standard_objects import is_pdo_mapping

_SHAPE = "CiA 301, 7.4.3"
_NAMES = "CiA 306, 4.6.3: ParameterName"
_STRUCTURE = 0xFF
#: The pre-defined error field: its sub-index 0 counts the errors that are in it (CiA 301, 1003h).
_ERRORS = 0x1003
_LONGEST_NAME = 241
_FLAGS = 0b11


@check("highest-sub-index", WARNING, "sub-index 0 is not the highest sub-index in the file", _SHAPE)
def highest_sub_index(device: DescribedDevice) -> Found:
    """Who reads the object by it misses some, or asks for what is not there."""
    for found in _of_many(device):
        first, stated = found.entries.get(0), device.number(found.index, 0)
        # One that can be written counts what the object holds, not what it could: errors, mapped objects.
        counts = found.index == _ERRORS or is_pdo_mapping(found.index)
        if first is None or stated is None or first.access.writable or counts:
            continue
        highest = max(found.entries.keys() - {_STRUCTURE})
        if highest and stated != highest:
            text = f"sub-index 00 holds {stated}, and the highest described is {highest} (0x{highest:02X})"
            yield Spot(found.index, 0, "parametervalue|defaultvalue"), text


@check("no-sub-index-0", WARNING, "an ARRAY or RECORD without sub-index 0", _SHAPE)
def no_sub_index_0(device: DescribedDevice) -> Found:
    """How many there are cannot be read."""
    for found in _of_many(device):
        if 0 not in found.entries:
            yield Spot(found.index), "no sub-index 00"


@check("sub-index-0-type", WARNING, "sub-index 0 of an ARRAY or RECORD is no UNSIGNED8", _SHAPE)
def sub_index_0_type(device: DescribedDevice) -> Found:
    """Who reads it takes a byte."""
    for found in _of_many(device):
        first = found.entries.get(0)
        if first is not None and first.data_type not in (None, U8):
            yield at(first, "datatype"), "sub-index 00 of an object of many is an UNSIGNED8"


@check("mixed-array", NOTE, "the elements of an ARRAY are of several data types", _SHAPE)
def mixed_array(device: DescribedDevice) -> Found:
    """That would be a RECORD."""
    for found in _of_many(device):
        kinds = {entry.data_type.name for sub, entry in found.entries.items() if sub and entry.data_type is not None}
        if found.object_type == ObjectType.ARRAY and len(kinds) > 1:
            yield Spot(found.index, key="objecttype"), f"an ARRAY of {' and '.join(sorted(kinds))}"


@check("array-gap", NOTE, "an ARRAY has a gap between its sub-indices", _SHAPE)
def array_gap(device: DescribedDevice) -> Found:
    """Who goes through it meets an abort."""
    for found in _of_many(device):
        held = found.entries.keys() - {_STRUCTURE}
        missing = [sub for sub in range(1, max(held)) if sub not in held] if held else []
        if found.object_type == ObjectType.ARRAY and missing:
            yield Spot(found.index), f"no sub-index {missing[0]:02X}, but {max(held):02X}"


@check("long-name", NOTE, "ParameterName has more than 241 characters", _NAMES)
def long_name(device: DescribedDevice) -> Found:
    """Some readers cut it."""
    for entry in device.entries:
        if len(entry.name) > _LONGEST_NAME:
            yield at(entry, "parametername"), f"the name has {len(entry.name)} characters; {_LONGEST_NAME} are allowed"


@check("same-name", NOTE, "two sub-indices of one object have the same name", _NAMES)
def same_name(device: DescribedDevice) -> Found:
    """Neither can be found by it."""
    for found in device.objects:
        names = Counter(normalised(entry.name) for entry in found.entries.values())
        for entry in found.entries.values():
            if names[normalised(entry.name)] > 1 and entry.sub_index:
                yield at(entry, "parametername"), f'another sub-index is called "{entry.name[:40]}", too'


@check("object-flags", NOTE, "ObjFlags has bits without a meaning", "CiA 306, 4.6.3: ObjFlags")
def object_flags(device: DescribedDevice) -> Found:
    """Bit 0 refuses a write of the whole configuration, bit 1 a read of it."""
    for entry in device.entries:
        if entry.object_flags & ~_FLAGS:
            yield at(entry, "objflags"), f"ObjFlags 0x{entry.object_flags:X}: bits above 1 have no meaning"


def _of_many(device: DescribedDevice) -> list[OdObject]:
    """The objects that are an ARRAY or a RECORD and have something."""
    return [found for found in device.objects if found.object_type in OF_MANY and found.entries]
