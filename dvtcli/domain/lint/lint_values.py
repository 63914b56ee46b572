"""Rules about the values of objects: defaults and set values against their limits and the node-ID.

Does not know what an object is for.
"""

from __future__ import annotations

from dataclasses import replace

from dvtcli.domain.datatypes import Kind
from dvtcli.domain.lint.described import DescribedDevice, Found, at
from dvtcli.domain.lint.lint_rule import ERROR, NOTE, WARNING, check
from dvtcli.domain.object_dictionary import Access, OdEntry
from dvtcli.domain.rules.described_step import leave_a_choice

_LIMITS = "CiA 306, 4.6.3: LowLimit, HighLimit"
_HIGHEST_NODE_ID = 127
#: Store and restore: what is read there (what the device can) is not what is written (a signature).
_SIGNED = (0x1010, 0x1011)


@check("default-outside-limits", ERROR, "DefaultValue is below LowLimit or above HighLimit", _LIMITS)
def default_outside_limits(device: DescribedDevice) -> Found:
    """The object would come up with what may not be written to it."""
    for entry in device.entries:
        if entry.default is not None and (text := _outside(entry, entry.default, relative=entry.default_relative)):
            yield at(entry, "defaultvalue"), f"DefaultValue {text}"


@check("value-outside-limits", ERROR, "ParameterValue is below LowLimit or above HighLimit", _LIMITS)
def value_outside_limits(device: DescribedDevice) -> Found:
    """The device would refuse what the file sets."""
    for entry in device.entries:
        if entry.value is None or not entry.access.writable or entry.index in _SIGNED:
            continue
        if text := _outside(entry, entry.value, relative=entry.value_relative):
            yield at(entry, "parametervalue"), f"ParameterValue {text}"


@check("value-of-read-only", NOTE, "ParameterValue is not the default of an object that cannot be written",
       "CiA 306, 5: ParameterValue")  # fmt: skip
def value_of_read_only(device: DescribedDevice) -> Found:
    """No tool can bring it into the device."""
    for entry in device.entries:
        if entry.value is None or entry.default is None or entry.access.writable:
            continue
        default = replace(entry, value=None)
        if all(entry.initial(node_id) != default.initial(node_id) for node_id in device.node_ids):
            yield at(entry, "parametervalue"), f"ParameterValue is not DefaultValue, and the object is {entry.access}"


@check("one-limit", NOTE, "only one of LowLimit and HighLimit is given", _LIMITS)
def one_limit(device: DescribedDevice) -> Found:
    """The other one is the data type's."""
    for entry in device.entries:
        if (entry.low is None) != (entry.high is None):
            given, missing = ("lowlimit", "HighLimit") if entry.high is None else ("highlimit", "LowLimit")
            yield at(entry, given), f"no {missing}: the data type's counts"


@check("node-id-overflow", WARNING, "a value with $NODEID does not fit the data type for every node-ID",
       "CiA 306, 4.6.3: $NODEID")  # fmt: skip
def node_id_overflow(device: DescribedDevice) -> Found:
    """It would wrap round on nodes with a high number."""
    for entry in device.entries:
        for data, relative, key in (
            (entry.default, entry.default_relative, "DefaultValue"),
            (entry.value, entry.value_relative, "ParameterValue"),
        ):
            if data is not None and relative and _most(entry) < _unsigned(data) + _HIGHEST_NODE_ID:
                yield at(entry, key.lower()), f"{key} is beyond the data type for node {_HIGHEST_NODE_ID}"


@check("constant-without-value", NOTE, "a const object has no DefaultValue", "CiA 306, 4.6.3: AccessType const")
def constant_without_value(device: DescribedDevice) -> Found:
    """The file could say what it always holds."""
    for entry in device.entries:
        if entry.access is Access.CONST and entry.default is None and entry.value is None:
            yield at(entry), "const, and no DefaultValue says what it holds"


def _outside(entry: OdEntry, data: bytes, *, relative: bool) -> str:
    """What is wrong with *data* against the limits, empty where nothing is, or where they leave no choice."""
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
    """A whole number beyond a few as the field writes it, too: `512 (0x200)`."""
    return f"{value} (0x{value:X})" if isinstance(value, int) and value > 9 else str(value)


def _most(entry: OdEntry) -> int:
    limits = None if entry.data_type is None else entry.data_type.limits
    return 0xFFFF_FFFF if limits is None else limits[1]


def _unsigned(data: bytes) -> int:
    return int.from_bytes(data, "little")
