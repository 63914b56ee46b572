"""Objects that a file describes in short: CompactSubObj arrays and CompactPDO parameters (CiA 306).

Knows what stands for what. Does not know other objects of the file.
"""

from __future__ import annotations

from dataclasses import replace

from dvtcli.domain.datatypes import U8
from dvtcli.domain.object_dictionary import Access, ObjectType, OdEntry, OdObject
from dvtcli.domain.standard_objects import PDO_COMMUNICATION, PDO_MAPPING, is_pdo_mapping, standard_entry
from dvtcli.files.eds.entry import EntryPlace, read_entry
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import Values
from dvtcli.files.eds.read_rules import COMPACT_COUNT

_PARAMETER_NAMES = (
    "Highest sub-index supported",
    "COB-ID",
    "Transmission type",
    "Inhibit time",
    "Compatibility entry",
    "Event timer",
    "SYNC start value",
)
_MAX_MAPPED = 64
_PREDEFINED_PDOS = 4
_NO_PDO = 1 << 31


def compact_entries(values: Values, place: EntryPlace, count: int, findings: Findings) -> dict[int, OdEntry]:
    """The *count* + 1 sub-indices that `CompactSubObj=count` stands for; all take the object's own keys."""
    member = read_entry(values, replace(place, sub_index=1), findings)
    entries = {0: _count_entry(member, count, findings)}
    for sub_index in range(1, count + 1):
        entries[sub_index] = replace(member, sub_index=sub_index, name=f"{member.name}{sub_index}")
    return entries


def _count_entry(member: OdEntry, count: int, findings: Findings) -> OdEntry:
    """Sub-index 0: NrOfObjects, UNSIGNED8, ro, *count* (CiA 306, 4.6.3.3), but not where CiA 301 has it written to."""
    access = Access.RO
    standard = standard_entry(member.index, 0)
    if standard is not None and standard.access is Access.RW and member.access.writable:
        access = Access.RW
        text = "sub-index 00 taken as rw (CiA 301), though CompactSubObj makes it ro"
        findings.add(COMPACT_COUNT, member.line or 1, text)
    return OdEntry(
        member.index,
        0,
        "NrOfObjects",
        U8,
        access,
        pdo_mapping=None if member.pdo_mapping is None else False,
        default=bytes([count]),
        object_flags=member.object_flags,
        line=member.line,
    )


def mapping_count(entries: dict[int, OdEntry]) -> OdEntry:
    """Sub-index 0 of a compact PDO mapping: how many of its *entries*, from the first, map something.

    CiA 306 gives sub-index 0 the number of sub-indices, but in a mapping it is the number of mapped objects
    (CiA 301, 7.5.2.36). Not known (None) where the file has no mapping entry at all. A list of values that says the
    entries from the first on, and no count, wants as many.
    """
    held = [entry.initial(0) for sub_index, entry in sorted(entries.items()) if sub_index]
    mapped = next((n for n, data in enumerate(held) if data is None or not any(data)), len(held))
    unknown = all(data is None for data in held)
    count, said = entries[0], [sub for sub, entry in entries.items() if sub and entry.value is not None]
    wanted = bytes([mapped]) if count.value is None and said and max(said) <= mapped else count.value
    return replace(count, default=None if unknown else bytes([mapped]), value=wanted)


def compact_pdo_indices(present: set[int], rpdo_count: int, tpdo_count: int) -> list[int]:
    """The PDO parameters that CompactPDO makes exist beside those *present*.

    The lowest PDO numbers that no section describes, until there are *rpdo_count* RPDOs and *tpdo_count* TPDOs;
    and the other half of every PDO that has only its communication or only its mapping described.
    """
    missing: list[int] = []
    for first, wanted in ((0x1400, rpdo_count), (0x1800, tpdo_count)):
        described = {i & 0x1FF for i in present if first <= i <= first + 0x3FF}
        free = (number for number in range(512) if number not in described)
        numbers = described | {number for number, _ in zip(free, range(wanted - len(described)), strict=False)}
        both = (first + offset + number for number in numbers for offset in (0, 0x200))
        missing += [index for index in both if index not in present]
    return missing


def compact_pdo_object(index: int, mask: int, line: int) -> OdObject:
    """The PDO parameter *index* as CompactPDO=*mask* describes it: bit 0..5 set = sub-index 1..6 exists.

    Access and types are CiA 301's; *line* is where the file says CompactPDO.
    """
    kind = "RPDO" if index < 0x1800 else "TPDO"
    if is_pdo_mapping(index):
        name, entries = f"{kind} mapping parameter", _mapping_entries(index, line)
    else:
        name, entries = f"{kind} communication parameter", _communication_entries(index, mask, line)
    return OdObject(index, name, ObjectType.RECORD, entries, line)


def _mapping_entries(index: int, line: int) -> dict[int, OdEntry]:
    entries = {0: OdEntry(index, 0, "Number of mapped objects", PDO_MAPPING[0].data_type, Access.RW, line=line)}
    for sub_index in range(1, _MAX_MAPPED + 1):
        name = f"Mapped object {sub_index}"
        entries[sub_index] = OdEntry(index, sub_index, name, PDO_MAPPING[1].data_type, Access.RW, line=line)
    return entries


def _communication_entries(index: int, mask: int, line: int) -> dict[int, OdEntry]:
    present = [bit + 1 for bit in range(6) if mask >> bit & 1]
    entries = {}
    for sub_index in [0, *present]:
        standard = PDO_COMMUNICATION[sub_index]
        access = standard.access or Access.RW
        name = _PARAMETER_NAMES[sub_index]
        entries[sub_index] = OdEntry(index, sub_index, name, standard.data_type, access, line=line)
    entries[0] = replace(entries[0], default=bytes([max(present, default=0)]))
    if 1 in entries:
        entries[1] = _with_default_cob_id(entries[1])
    return entries


def _with_default_cob_id(entry: OdEntry) -> OdEntry:
    """PDOs 1..4 start with the pre-defined connection set, the others disabled (CiA 301, 7.5.2.35 and 7.5.2.37)."""
    number = (entry.index & 0x1FF) + 1
    if number > _PREDEFINED_PDOS:
        return replace(entry, default=_NO_PDO.to_bytes(4, "little"))
    base = 0x100 * number + (0x80 if entry.index >= 0x1800 else 0x100)
    return replace(entry, default=base.to_bytes(4, "little"), default_relative=True)
