"""Data types, access and names of the communication objects in CiA 301, for files that lack them."""

from __future__ import annotations

from typing import NamedTuple

from dvtcli.domain.datatypes import U8, U16, U32, VISIBLE_STRING, DataType
from dvtcli.domain.object_dictionary import Access, ObjectType
from dvtcli.domain.objects import (
    GUARD_TIME,
    IDENTITY,
    LIFE_TIME_FACTOR,
    PRODUCER_HEARTBEAT,
    SAFETY,
    SAFETY_SIGNATURES,
    SRDO_COMMUNICATION,
    SRDO_MAPPING,
)
from dvtcli.domain.pdo import DISPATCHER_LISTS, PDO_INDICES, SCANNER_LISTS, is_mapping_index

_STORED = ("all parameters", "communication parameters", "application parameters")
_PARTS = {
    0x1010: _STORED,
    0x1011: _STORED,
    0x1018: ("vendor-ID", "product code", "revision number", "serial number"),
    0x1029: ("communication error",),
}
_NAMES = {
    0x1000: "device type", 0x1001: "error register", 0x1002: "manufacturer status register", 0x1005: "COB-ID SYNC",
    0x1006: "communication cycle period", 0x1007: "synchronous window length", 0x1008: "manufacturer device name",
    0x1009: "manufacturer hardware version", 0x100A: "manufacturer software version", 0x100C: "guard time",
    0x100D: "life time factor", 0x1012: "COB-ID TIME", 0x1013: "high resolution time stamp", 0x1014: "COB-ID EMCY",
    0x1015: "inhibit time EMCY", 0x1017: "producer heartbeat time", 0x1019: "synchronous counter overflow value",
    0x1300: "global fail-safe command", 0x13FE: "configuration valid",
}  # fmt: skip
_ONE_EACH = {0x1003: "error", 0x1016: "consumer heartbeat time"}
_SDO = ("COB-ID client to server", "COB-ID server to client", "node-ID of the other side")
_SRDO = (
    "information direction", "refresh time or SCT", "SRVT", "transmission type", "COB-ID 1", "COB-ID 2 (inverted)",
)  # fmt: skip
_COMMUNICATION = ("COB-ID", "transmission type", "inhibit time", "reserved", "event timer", "SYNC start value")


#: clauses of CiA 301, one for each object or range of objects, from 7.5.2.1 on
_IN_ORDER = (
    *(0x1000, 0x1001, 0x1002, 0x1003, 0x1005, 0x1006, 0x1007, 0x1008, 0x1009, 0x100A, 0x100C, 0x100D),
    *range(0x1010, 0x101A), *range(0x1020, 0x102A),
    *(0x1200, 0x1280, 0x1400, 0x1600, 0x1800, 0x1A00, 0x1FA0, 0x1FD0),
)  # fmt: skip
#: the clause of CiA 301 that describes an object; of records such as PDOs by the first index
CLAUSES = {index: f"7.5.2.{number}" for number, index in enumerate(_IN_ORDER, 1)}


def source(*indices: int) -> str:
    """The place in CiA 301 where *indices* are described: `CiA 301, 7.5.2.13 and 7.5.2.14`."""
    *clauses, last = (CLAUSES[index] for index in indices)
    return f"CiA 301, {', '.join(clauses)}{' and ' if clauses else ''}{last}"


def standard_name(index: int, sub_index: int) -> str:
    """The name of *index*:*sub_index* in CiA 301, 7.5.2, empty if unnamed, as sub-index 0 of a record or an array."""
    if sub_index == 0:
        return _NAMES.get(index, "")
    if index in _ONE_EACH:
        return f"{_ONE_EACH[index]} {sub_index}"
    if is_pdo_mapping(index) or index in SRDO_MAPPING:
        return f"mapped object {sub_index}"
    if index in SCANNER_LISTS or index in DISPATCHER_LISTS:
        return f"{'scanned' if index in SCANNER_LISTS else 'dispatched'} objects {sub_index}"
    if index == SAFETY_SIGNATURES:
        return f"signature of SRDO {sub_index}"
    names = _PARTS.get(index, ())
    if is_pdo_communication(index):
        names = _COMMUNICATION
    elif 0x1200 <= index <= 0x12FF:
        names = _SDO
    elif index in SRDO_COMMUNICATION:
        names = _SRDO
    return names[sub_index - 1] if 1 <= sub_index <= len(names) else ""


class StandardEntry(NamedTuple):
    """Data type and access of a sub-index in CiA 301; *access* is None if the standard leaves a choice."""

    data_type: DataType
    access: Access | None


#: The highest sub-index of the identity object.
_IDENTITY_LENGTH = 4
_RO, _RW, _CONST = Access.RO, Access.RW, Access.CONST

#: VAR objects (CiA 301, 7.5.2).
_VARIABLES = {
    0x1000: StandardEntry(U32, _RO),
    0x1001: StandardEntry(U8, _RO),
    0x1002: StandardEntry(U32, _RO),
    0x1005: StandardEntry(U32, _RW),
    0x1006: StandardEntry(U32, _RW),
    0x1007: StandardEntry(U32, _RW),
    0x1008: StandardEntry(VISIBLE_STRING, _CONST),
    0x1009: StandardEntry(VISIBLE_STRING, _CONST),
    0x100A: StandardEntry(VISIBLE_STRING, _CONST),
    0x100C: StandardEntry(U16, _RW),
    0x100D: StandardEntry(U8, _RW),
    0x1012: StandardEntry(U32, _RW),
    0x1013: StandardEntry(U32, _RW),
    0x1014: StandardEntry(U32, None),
    0x1015: StandardEntry(U16, _RW),
    0x1017: StandardEntry(U16, _RW),
    0x1019: StandardEntry(U8, _RW),
    0x102A: StandardEntry(U16, _RW),
}

#: ARRAY objects, and 0x1018 with entries of equal type: sub-index 0, every other sub-index.
_ARRAYS = {
    0x1003: (StandardEntry(U8, _RW), StandardEntry(U32, _RO)),
    0x1010: (StandardEntry(U8, _CONST), StandardEntry(U32, _RW)),
    0x1011: (StandardEntry(U8, _CONST), StandardEntry(U32, _RW)),
    0x1016: (StandardEntry(U8, _CONST), StandardEntry(U32, _RW)),
    0x1018: (StandardEntry(U8, _CONST), StandardEntry(U32, _RO)),
    0x1020: (StandardEntry(U8, _CONST), StandardEntry(U32, _RW)),
    0x1028: (StandardEntry(U8, _CONST), StandardEntry(U32, _RW)),
    0x1029: (StandardEntry(U8, _CONST), StandardEntry(U8, _RW)),
}

#: Safety objects of EN 50325-5, whose access a device chooses: an SRDO's communication parameter by sub-index, the
#: count and entries of its mapping, and of the signatures.
_SRDO_PARAMETER = tuple(StandardEntry(kind, None) for kind in (U8, U8, U16, U8, U8, U32, U32))
_SRDO_ENTRIES = (StandardEntry(U8, None), StandardEntry(U32, None))
_SIGNATURES = (StandardEntry(U8, None), StandardEntry(U16, None))
_SAFETY_VARIABLES = {0x1300: StandardEntry(U8, None), 0x13FE: StandardEntry(U8, None)}

#: SDO parameter records (7.5.2.33 and 7.5.2.34); a server's COB-IDs may be ro or rw.
_SDO_PARAMETER = (
    StandardEntry(U8, _CONST),
    StandardEntry(U32, None),
    StandardEntry(U32, None),
    StandardEntry(U8, _RW),
)

#: PDO communication parameter records (7.5.2.35 and 7.5.2.37), by sub-index.
PDO_COMMUNICATION = (
    StandardEntry(U8, _CONST),
    StandardEntry(U32, _RW),
    StandardEntry(U8, _RW),
    StandardEntry(U16, _RW),
    StandardEntry(U8, _RW),
    StandardEntry(U16, _RW),
    StandardEntry(U8, _RW),
)

#: PDO mapping parameter records (7.5.2.36 and 7.5.2.38): sub-index 0, and 1..64.
PDO_MAPPING = (StandardEntry(U8, _RW), StandardEntry(U32, _RW))


def is_pdo_communication(index: int) -> bool:
    """Whether *index* is an RPDO's or TPDO's communication parameter."""
    return 0x1400 <= index <= 0x15FF or 0x1800 <= index <= 0x19FF


def is_srdo_mapping(index: int) -> bool:
    """Whether *index* is the mapping parameter of an SRDO (EN 50325-5)."""
    return index in SRDO_MAPPING


def is_pdo_mapping(index: int) -> bool:
    """Whether *index* is an RPDO's or TPDO's mapping parameter."""
    return index in PDO_INDICES and is_mapping_index(index)


def standard_entry(index: int, sub_index: int) -> StandardEntry | None:
    """Entry for *index*:*sub_index* in CiA 301, or None."""
    if sub_index == 0 and index in _VARIABLES:
        return _VARIABLES[index]
    if index == IDENTITY and sub_index > _IDENTITY_LENGTH:
        return None
    if index in _ARRAYS:
        return _ARRAYS[index][min(sub_index, 1)]
    if 0x1200 <= index <= 0x12FF:
        return _SDO_PARAMETER[sub_index] if sub_index < len(_SDO_PARAMETER) else None
    if is_pdo_communication(index):
        return PDO_COMMUNICATION[sub_index] if sub_index < len(PDO_COMMUNICATION) else None
    if is_pdo_mapping(index) and sub_index <= 64:
        return PDO_MAPPING[min(sub_index, 1)]
    return _safety_entry(index, sub_index) if index in SAFETY else None


def _safety_entry(index: int, sub_index: int) -> StandardEntry | None:
    if index in SRDO_COMMUNICATION:
        return _SRDO_PARAMETER[sub_index] if sub_index < len(_SRDO_PARAMETER) else None
    if index in SRDO_MAPPING:
        return _SRDO_ENTRIES[min(sub_index, 1)]
    if index == SAFETY_SIGNATURES:
        return _SIGNATURES[min(sub_index, 1)]
    return _SAFETY_VARIABLES.get(index) if sub_index == 0 else None


#: Objects whose access CiA 301 leaves open, though it has them rw: a value that the device cannot change.
_MAY_BE_FIXED = {GUARD_TIME: (_RO, _CONST), LIFE_TIME_FACTOR: (_RO, _CONST), PRODUCER_HEARTBEAT: (_CONST,)}
#: Objects of the communication area with PDO mapping *optional*; of all others CiA 301 says *no*.
_MAPPABLE = (0x1001, 0x1002, 0x1013)
_SDO_COB_IDS = (1, 2)


def must_be_writable(index: int, sub_index: int, access: Access) -> bool:
    """Whether *access*, of an object that cannot be written, is against CiA 301; a PDO may be fixed as a whole."""
    standard = standard_entry(index, sub_index)
    is_fixed = access in _MAY_BE_FIXED.get(index, ()) or is_pdo_communication(index) or is_pdo_mapping(index)
    return standard is not None and standard.access is _RW and not access.writable and not is_fixed


def must_not_be_mapped(index: int, sub_index: int) -> bool:
    """Whether CiA 301 says *PDO mapping: no* of *index*:*sub_index*."""
    is_sdo_cob_id = 0x1200 <= index <= 0x12FF and sub_index in _SDO_COB_IDS
    return standard_entry(index, sub_index) is not None and index not in _MAPPABLE and not is_sdo_cob_id


def reserved_sub_index(index: int, sub_index: int) -> bool:
    """Whether CiA 301 reserves *sub_index* of the PDO communication parameter *index* (7.5.2.35 and 7.5.2.37)."""
    return is_pdo_communication(index) and sub_index == 4


def standard_object_type(index: int) -> ObjectType | None:
    """The object type of *index* in CiA 301, or None."""
    if index in _VARIABLES:
        return ObjectType.VAR
    if index in _ARRAYS and index != IDENTITY:
        return ObjectType.ARRAY
    record = index == IDENTITY or 0x1200 <= index <= 0x12FF or is_pdo_communication(index) or is_pdo_mapping(index)
    return ObjectType.RECORD if record else None


#: Reserved indices in CiA 301: first and last of each range (7.4.1, table of the object dictionary).
_RESERVED = ((0x0000, 0x0000), (0x0260, 0x0FFF), (0x1004, 0x1004), (0x100B, 0x100B), (0x100E, 0x100F), (0xC000, 0xFFFF))


def reserved(index: int) -> bool:
    """Whether CiA 301 reserves *index*."""
    return any(first <= index <= last for first, last in _RESERVED)
