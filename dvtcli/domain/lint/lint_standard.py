"""Rules about the communication objects of CiA 301: which there must be, and their types and access.

Does not know PDOs beyond the shape of their parameters (`lint_pdos`).
"""

from __future__ import annotations

from dvtcli.domain.lint.described import OF_MANY, DescribedDevice, Found, Spot, at
from dvtcli.domain.lint.lint_rule import ERROR, NOTE, WARNING, check
from dvtcli.domain.object_dictionary import Access, ObjectType
from dvtcli.domain.standard_objects import reserved, standard_entry, standard_object_type

_NAMES = {0x1000: "device type", 0x1001: "error register", 0x1018: "identity object"}
_HEARTBEAT, _GUARD_TIME, _LIFE_TIME = 0x1017, 0x100C, 0x100D


@check("mandatory-object", ERROR, "0x1000, 0x1001 or 0x1018 is missing", "CiA 301, 7.5.2.1, 7.5.2.2 and 7.5.2.21")
def mandatory_object(device: DescribedDevice) -> Found:
    """Every device has them."""
    for index, name in _NAMES.items():
        if index not in device.dictionary:
            yield Spot(section="mandatoryobjects"), f"{index:04X} ({name}) is missing: every device must have it"


@check("vendor-id-object", ERROR, "0x1018 has no sub-index 01, the vendor-ID", "CiA 301, 7.5.2.21")
def vendor_id_object(device: DescribedDevice) -> Found:
    """The other parts of the identity may be left out."""
    if 0x1018 in device.dictionary and 1 not in device.dictionary[0x1018].entries:
        yield Spot(0x1018), "no sub-index 01: the vendor-ID must be there"


@check("standard-type", ERROR, "an object of 0x1000 to 0x1BFF has another length than CiA 301 says", "CiA 301, 7.5.2")
def standard_type(device: DescribedDevice) -> Found:
    """Every master writes them with the standard's length, and is refused."""
    yield from _other_types(device, of_same_length=False)


@check("standard-kind", WARNING, "an object of 0x1000 to 0x1BFF has another data type than CiA 301 says, of the same "
       "length", "CiA 301, 7.5.2")  # fmt: skip
def standard_kind(device: DescribedDevice) -> Found:
    """COB-IDs and identities read as negative numbers."""
    yield from _other_types(device, of_same_length=True)


@check("standard-access", WARNING, "an object of 0x1000 to 0x1BFF cannot be read, or can be written where CiA 301 "
       "has it fixed", "CiA 301, 7.5.2")  # fmt: skip
def standard_access(device: DescribedDevice) -> Found:
    """That a device fixes what may be written is its right, and said of PDOs by `fixed-pdo`."""
    for entry in device.entries:
        standard = standard_entry(entry.index, entry.sub_index)
        if standard is None or standard.access is None:
            continue
        if entry.access is Access.WO or (entry.access.writable and not standard.access.writable):
            yield at(entry, "accesstype"), f"is {entry.access}; CiA 301 has {standard.access}"


@check("standard-object-type", WARNING, "an object of 0x1000 to 0x1BFF is of one entry where CiA 301 has sub-indices, "
       "or the reverse", "CiA 301, 7.5.2")  # fmt: skip
def standard_shape(device: DescribedDevice) -> Found:
    """Whoever reads its sub-index 0 gets something else than meant."""
    for found in device.objects:
        standard = standard_object_type(found.index)
        if standard is not None and (found.object_type in OF_MANY) is not (standard in OF_MANY):
            yield Spot(found.index, key="objecttype"), f"is {_object_type(found.object_type)}; CiA 301: {standard.name}"


@check("array-or-record", NOTE, "an object of 0x1000 to 0x1BFF is an ARRAY where CiA 301 has a RECORD, or the reverse",
       "CiA 301, 7.5.2")  # fmt: skip
def array_or_record(device: DescribedDevice) -> Found:
    """Some libraries write nothing to a mapping that is an ARRAY."""
    for found in device.objects:
        standard = standard_object_type(found.index)
        if standard in OF_MANY and found.object_type in OF_MANY and standard != found.object_type:
            yield Spot(found.index, key="objecttype"), f"is {_object_type(found.object_type)}; CiA 301: {standard.name}"


@check("reserved-index", WARNING, "an index that CiA 301 reserves", "CiA 301, 7.4.1 and 7.5.2")
def reserved_index(device: DescribedDevice) -> Found:
    """A later version of the standard may put something else there."""
    for index in device.dictionary:
        if reserved(index):
            yield Spot(index), "the index is reserved"


@check("no-error-control", WARNING, "neither heartbeat (0x1017) nor guarding (0x100C and 0x100D)",
       "CiA 301, 7.2.8.2.2")  # fmt: skip
def no_error_control(device: DescribedDevice) -> Found:
    """Nobody can see that the node is gone."""
    if device.dictionary and _HEARTBEAT not in device.dictionary and _GUARD_TIME not in device.dictionary:
        yield Spot(section="optionalobjects"), "neither 1017 (heartbeat) nor 100C and 100D (guarding) is described"


@check("half-guarding", WARNING, "guard time without life time factor, or the reverse", "CiA 301, 7.5.2.11, 7.5.2.12")
def half_guarding(device: DescribedDevice) -> Found:
    """Guarding takes both."""
    for there, missing in ((_GUARD_TIME, _LIFE_TIME), (_LIFE_TIME, _GUARD_TIME)):
        if there in device.dictionary and missing not in device.dictionary:
            yield Spot(there), f"without {missing:04X}: guarding takes both"


def _other_types(device: DescribedDevice, *, of_same_length: bool) -> Found:
    for entry in device.entries:
        standard = standard_entry(entry.index, entry.sub_index)
        if standard is None or entry.data_type is None or entry.data_type == standard.data_type:
            continue
        if (entry.bits == standard.data_type.bits) is of_same_length:
            yield at(entry, "datatype"), f"is {entry.data_type.name}; CiA 301 has {standard.data_type.name}"


def _object_type(code: int) -> str:
    known = next((object_type.name for object_type in ObjectType if object_type == code), "")
    return known or f"0x{code:X}"
