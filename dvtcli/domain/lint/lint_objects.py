"""Rules about the structure of objects: sub-index 0, arrays, names, flags."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from dvtcli.domain.datatypes import U8, Kind
from dvtcli.domain.lint import ERROR, NOTE, WARNING, check
from dvtcli.domain.lint.described import OF_MANY, DescribedDevice, Found, Spot, at
from dvtcli.domain.object_dictionary import Access, ObjectType, OdEntry, OdObject, normalised
from dvtcli.domain.objects import ERROR_FIELD, MODULE_LIST, RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.pdo import MAX_PDO_BITS
from dvtcli.domain.rules.communication import leave_a_choice
from dvtcli.domain.standard_objects import is_pdo_mapping, must_not_be_mapped

_SHAPE = "CiA 301, 7.4.3"
_NAMES = "CiA 306, 4.6.3: ParameterName"
_STRUCTURE = 0xFF
_LONGEST_NAME = 241
_FLAGS = 0b11


@check("highest-sub-index", WARNING, "sub-index 0 is not the highest sub-index in the file", _SHAPE)
def highest_sub_index(device: DescribedDevice) -> Found:
    """A wrong count hides sub-indices from readers, or makes them read missing ones."""
    for found in _of_many(device):
        first, stated = found.entries.get(0), device.number(found.index, 0)
        # A writable count is the number of present entries, not of possible ones: errors, modules, mapped objects.
        counts = found.index in (ERROR_FIELD, MODULE_LIST) or is_pdo_mapping(found.index)
        if first is None or stated is None or first.access.writable or counts:
            continue
        highest = max(found.entries.keys() - {_STRUCTURE})
        if highest and stated != highest:
            text = f"sub-index 00 is {stated}, but the highest described sub-index is {highest} (0x{highest:02X})"
            yield Spot(found.index, 0, "parametervalue|defaultvalue"), text


@check("no-sub-index-0", WARNING, "an ARRAY or RECORD without sub-index 0", _SHAPE)
def no_sub_index_0(device: DescribedDevice) -> Found:
    """Without sub-index 0 the number of entries cannot be read."""
    for found in _of_many(device):
        if 0 not in found.entries:
            yield Spot(found.index), "no sub-index 00"


@check("sub-index-0-type", WARNING, "sub-index 0 of an ARRAY or RECORD is not an UNSIGNED8", _SHAPE)
def sub_index_0_type(device: DescribedDevice) -> Found:
    """Readers expect a byte."""
    for found in _of_many(device):
        first = found.entries.get(0)
        if first is not None and first.data_type not in (None, U8):
            yield at(first, "datatype"), "sub-index 00 of an object of many is an UNSIGNED8"


@check("mixed-array", NOTE, "the elements of an ARRAY are of several data types", _SHAPE)
def mixed_array(device: DescribedDevice) -> Found:
    """Entries of different types make a RECORD."""
    for found in _of_many(device):
        kinds = {entry.data_type.name for sub, entry in found.entries.items() if sub and entry.data_type is not None}
        if found.object_type == ObjectType.ARRAY and len(kinds) > 1:
            yield Spot(found.index, key="objecttype"), f"an ARRAY of {' and '.join(sorted(kinds))}"


@check("array-gap", NOTE, "an ARRAY has a gap between its sub-indices", _SHAPE)
def array_gap(device: DescribedDevice) -> Found:
    """A reader of all entries gets an abort at the gap."""
    for found in _of_many(device):
        held = found.entries.keys() - {_STRUCTURE}
        missing = [sub for sub in range(1, max(held)) if sub not in held] if held else []
        if found.object_type == ObjectType.ARRAY and missing:
            yield Spot(found.index), f"no sub-index {missing[0]:02X}, but {max(held):02X}"


@check("long-name", NOTE, "ParameterName has more than 241 characters", _NAMES)
def long_name(device: DescribedDevice) -> Found:
    """Some tools cut long names."""
    for entry in device.entries:
        if len(entry.name) > _LONGEST_NAME:
            yield at(entry, "parametername"), f"the name has {len(entry.name)} characters; {_LONGEST_NAME} are allowed"


@check("same-name", NOTE, "two sub-indices of one object have the same name", _NAMES)
def same_name(device: DescribedDevice) -> Found:
    """Neither entry can be found by its name."""
    for found in device.objects:
        names = Counter(normalised(entry.name) for entry in found.entries.values())
        for entry in found.entries.values():
            if names[normalised(entry.name)] > 1 and entry.sub_index:
                yield at(entry, "parametername"), f'another sub-index is called "{entry.name[:40]}", too'


@check("object-flags", NOTE, "ObjFlags has bits without a meaning", "CiA 306, 4.6.3: ObjFlags")
def object_flags(device: DescribedDevice) -> Found:
    """Bit 0 excludes an object from a download of the whole configuration, bit 1 from an upload."""
    for entry in device.entries:
        if entry.object_flags & ~_FLAGS:
            yield at(entry, "objflags"), f"ObjFlags 0x{entry.object_flags:X}: bits above 1 have no meaning"


def _of_many(device: DescribedDevice) -> list[OdObject]:
    """ARRAYs and RECORDs with entries."""
    return [found for found in device.objects if found.object_type in OF_MANY and found.entries]


_SOURCE = "CiA 306, 4.6.3: PDOMapping"


@check(
    "mappability-unknown", WARNING, "the file has PDOs, but no PDOMapping: the mappable objects are unknown", _SOURCE
)
def mappability_unknown(device: DescribedDevice) -> Found:
    """Tools offer everything, or nothing."""
    if device.pdos and not device.dictionary.tells_mappability:
        yield Spot(), "no object has PDOMapping: the mappable objects are unknown"


@check("unmappable-type", WARNING, "PDOMapping=1 on an object of variable length, or of more than 64 bits",
       "CiA 301, 7.5.2.36")  # fmt: skip
def unmappable_type(device: DescribedDevice) -> Found:
    """A mapping entry has a length of 1 to 64 bits."""
    for entry in device.entries:
        if entry.pdo_mapping and entry.data_type is not None and not 1 <= (entry.bits or 0) <= MAX_PDO_BITS:
            yield at(entry, "pdomapping"), f"PDOMapping=1, but a PDO cannot carry a {entry.data_type.name}"


@check(
    "mappable-parameter",
    WARNING,
    "PDOMapping=1 on an object of 0x1000 to 0x1BFF that CiA 301 does not allow in PDOs",
    "CiA 301, 7.5.2: PDO mapping",
)
def mappable_parameter(device: DescribedDevice) -> Found:
    """A PDO that changes PDOs."""
    for entry in device.entries:
        if entry.pdo_mapping and must_not_be_mapped(entry.index, entry.sub_index):
            yield at(entry, "pdomapping"), "PDOMapping=1 on a communication parameter"


@check("mappable-count", NOTE, "PDOMapping=1 on a sub-index 0 that counts", "CiA 301, 7.4.3")
def mappable_count(device: DescribedDevice) -> Found:
    """Hardly meant."""
    for found in device.objects:
        first = found.entries.get(0)
        if found.object_type in OF_MANY and len(found.entries) > 1 and first is not None and first.pdo_mapping:
            yield at(first, "pdomapping"), "PDOMapping=1 on the number of sub-indices"


@check("mappable-constant", NOTE, "PDOMapping=1 on a constant (const)", _SOURCE)
def mappable_constant(device: DescribedDevice) -> Found:
    """A constant would take space in every frame."""
    for entry in device.entries:
        if entry.pdo_mapping and entry.access is Access.CONST:
            yield at(entry, "pdomapping"), "PDOMapping=1, and the object is const"


@check("process-access", NOTE, "AccessType rwr or rww (for PDOs) on an object that cannot be mapped",
       "CiA 306, 4.6.3: AccessType")  # fmt: skip
def process_access(device: DescribedDevice) -> Found:
    """Either AccessType or PDOMapping is wrong."""
    for entry in device.entries:
        if entry.access in (Access.RWR, Access.RWW) and entry.pdo_mapping is False:
            yield at(entry, "accesstype"), f"AccessType={entry.access}, but PDOMapping=0"


@check("bits-below-granularity", NOTE, "PDOMapping=1 on an object whose length is not a multiple of Granularity",
       "CiA 306, DeviceInfo: Granularity")  # fmt: skip
def bits_below_granularity(device: DescribedDevice) -> Found:
    """`map` refuses it."""
    if device.dictionary.info.granularity != 8:
        return
    for entry in device.entries:
        if entry.pdo_mapping and entry.bits and entry.bits % 8:
            yield at(entry, "pdomapping"), f"PDOMapping=1 with {entry.bits} bits, but Granularity=8"


_LIMITS = "CiA 306, 4.6.3: LowLimit, HighLimit"
_HIGHEST_NODE_ID = 127
#: Store and restore: the value read (a capability) differs from the value written (a signature).
_SIGNED = (STORE_PARAMETERS, RESTORE_PARAMETERS)


@check("default-outside-limits", ERROR, "DefaultValue is below LowLimit or above HighLimit", _LIMITS)
def default_outside_limits(device: DescribedDevice) -> Found:
    """The device would come up with an illegal value."""
    for entry in device.entries:
        if entry.default is not None and (text := _outside(entry, entry.default, relative=entry.default_relative)):
            yield at(entry, "defaultvalue"), f"DefaultValue {text}"


@check("value-outside-limits", ERROR, "ParameterValue is below LowLimit or above HighLimit", _LIMITS)
def value_outside_limits(device: DescribedDevice) -> Found:
    """The device would refuse the file's value."""
    for entry in device.entries:
        if entry.value is None or not entry.access.writable or entry.index in _SIGNED:
            continue
        if text := _outside(entry, entry.value, relative=entry.value_relative):
            yield at(entry, "parametervalue"), f"ParameterValue {text}"


@check("value-of-read-only", NOTE, "ParameterValue is not the default of an object that cannot be written",
       "CiA 306, 5: ParameterValue")  # fmt: skip
def value_of_read_only(device: DescribedDevice) -> Found:
    """No tool can write the value to the device."""
    for entry in device.entries:
        if entry.value is None or entry.default is None or entry.access.writable:
            continue
        default = replace(entry, value=None)
        if all(entry.initial(node_id) != default.initial(node_id) for node_id in device.node_ids):
            yield at(entry, "parametervalue"), f"ParameterValue is not DefaultValue, and the object is {entry.access}"


@check("one-limit", NOTE, "only one of LowLimit and HighLimit is given", _LIMITS)
def one_limit(device: DescribedDevice) -> Found:
    """The missing limit is the data type's."""
    for entry in device.entries:
        if (entry.low is None) != (entry.high is None):
            given, missing = ("lowlimit", "HighLimit") if entry.high is None else ("highlimit", "LowLimit")
            yield at(entry, given), f"no {missing}: the data type's counts"


@check("node-id-overflow", WARNING, "a value with $NODEID does not fit the data type for every node-ID",
       "CiA 306, 4.6.3: $NODEID")  # fmt: skip
def node_id_overflow(device: DescribedDevice) -> Found:
    """The value would overflow on nodes with a high node-ID."""
    for entry in device.entries:
        for data, relative, key in (
            (entry.default, entry.default_relative, "DefaultValue"),
            (entry.value, entry.value_relative, "ParameterValue"),
        ):
            if data is not None and relative and _most(entry) < _unsigned(data) + _HIGHEST_NODE_ID:
                yield at(entry, key.lower()), f"{key} is beyond the data type for node {_HIGHEST_NODE_ID}"


@check("constant-without-value", NOTE, "a const object has no DefaultValue", "CiA 306, 4.6.3: AccessType const")
def constant_without_value(device: DescribedDevice) -> Found:
    """The file could give the constant's value."""
    for entry in device.entries:
        if entry.access is Access.CONST and entry.default is None and entry.value is None:
            yield at(entry), "const, without a DefaultValue"


def _outside(entry: OdEntry, data: bytes, *, relative: bool) -> str:
    """Violation of the limits by *data*, empty for none, or if the limits leave no choice."""
    if not leave_a_choice(entry, entry.low, entry.high):
        return ""
    if entry.data_type is None or entry.data_type.kind not in (Kind.INTEGER, Kind.UNSIGNED, Kind.REAL, Kind.BOOLEAN):
        return ""
    value = entry.data_type.decode(data)
    if not isinstance(value, int | float):
        return ""
    for limit, limit_relative, name, beyond in (
        (entry.low, entry.low_relative, "LowLimit", -1),
        (entry.high, entry.high_relative, "HighLimit", 1),
    ):
        # With $NODEID on one side only it depends on the node.
        if limit is not None and relative == limit_relative and (value - limit) * beyond > 0:
            return f"{_shown(value)} is {'below' if beyond < 0 else 'above'} {name} {_shown(limit)}"
    return ""


def _shown(value: float) -> str:
    """A whole number above 9 with its hexadecimal form: `512 (0x200)`."""
    return f"{value} (0x{value:X})" if isinstance(value, int) and value > 9 else str(value)


def _most(entry: OdEntry) -> int:
    limits = None if entry.data_type is None else entry.data_type.limits
    return 0xFFFF_FFFF if limits is None else limits[1]


def _unsigned(data: bytes) -> int:
    return int.from_bytes(data, "little")
