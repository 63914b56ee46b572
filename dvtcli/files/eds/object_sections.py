"""One object of an EDS or DCF: its sections -> an `OdObject`.

Knows the keys of objects and sub-indices (CiA 306, 4.6.3). Does not know other objects, nor what a device
makes of them. Every oddity goes to *findings*, and the reader goes on.
"""

from __future__ import annotations

from dvtcli.domain.object_dictionary import ObjectType, OdEntry, OdObject
from dvtcli.domain.standard_objects import is_pdo_mapping
from dvtcli.files.eds.compact import compact_entries, mapping_count
from dvtcli.files.eds.entry import EntryPlace, read_entry
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import Values, section_values
from dvtcli.files.eds.keys import number_key, text_key
from dvtcli.files.eds.layout import EdsLayout, ObjectSections, report_repeated
from dvtcli.files.eds.read_rules import (
    NO_OBJECT_TYPE,
    NO_PARENT,
    NO_SUB_INDICES,
    OBJECT_TYPE,
    SUB_BEFORE_PARENT,
    SUB_INDICES_OF_VAR,
    SUB_NUMBER,
)
from dvtcli.files.eds.tables import apply_tables

_KNOWN = frozenset(ObjectType)
_OF_ONE_ENTRY = (ObjectType.NULL, ObjectType.DOMAIN, ObjectType.DEFTYPE, ObjectType.VAR)


def build_object(layout: EdsLayout, index: int, findings: Findings) -> OdObject:
    """Read object *index*, which the file has at least one section of."""
    sections = layout.object_sections(index)
    line = sections.line
    report_repeated(sections.each(), findings, have_values=True)
    values = section_values(sections.own, findings)
    compact = number_key(values, "compactsubobj", 0, 254, findings) or 0
    object_type = _object_type(values, bool(sections.sub_indices), compact, line, findings)
    entries: dict[int, OdEntry] = {}
    if compact:
        entries = compact_entries(values, EntryPlace(index, 0, line, of_many=True), compact, findings)
    for sub_index in sorted(sections.sub_indices):
        parts = sections.sub_indices[sub_index]
        place = EntryPlace(index, sub_index, parts[0].line, of_many=True)
        entries[sub_index] = read_entry(section_values(parts, findings), place, findings)
    if not entries and object_type in _OF_ONE_ENTRY:
        domain = object_type == ObjectType.DOMAIN
        entries[0] = read_entry(values, EntryPlace(index, 0, line, of_many=False, domain=domain), findings)
    apply_tables(sections, entries, findings)
    if compact and is_pdo_mapping(index) and 0 not in sections.sub_indices:
        entries[0] = mapping_count(entries)
    _check_parts(index, sections, values, entries, findings)
    name = text_key(values, "parametername") or f"{index:04X}"
    own = object_type not in _OF_ONE_ENTRY and "objflags" in values
    flags = number_key(values, "objflags", 0, 0xFFFF_FFFF, findings) or 0 if own else 0
    return OdObject(index, name, object_type, entries, line, flags)


def _object_type(values: Values, has_subs: bool, compact: int, line: int, findings: Findings) -> int:
    """ObjectType, by default VAR (CiA 306, 4.6.3), but what has sub-indices is none."""
    given = number_key(values, "objecttype", 0, 0xFF, findings)
    likely = ObjectType.RECORD if has_subs else ObjectType.ARRAY if compact else ObjectType.VAR
    if given is None:
        if values and likely is not ObjectType.VAR:
            findings.add(NO_OBJECT_TYPE, line, f"no ObjectType, yet sub-indices: taken as {likely.name}")
        return likely
    line = values["objecttype"].line
    if likely is not ObjectType.VAR and given in _OF_ONE_ENTRY:
        findings.add(SUB_INDICES_OF_VAR, line, f"ObjectType {given} has no sub-indices, yet the file lists some")
        return likely
    if given not in _KNOWN:
        findings.add(OBJECT_TYPE, line, f"ObjectType {given} is not known (CiA 301, table 42)")
    return given


def _check_parts(
    index: int, sections: ObjectSections, values: Values, entries: dict[int, OdEntry], findings: Findings
) -> None:
    """What does not add up between an object's section and its sub-indices."""
    line = sections.line
    if not sections.own:
        findings.add(NO_PARENT, line, f"sub-indices, but no section [{index:04X}]")
        return
    early = [parts[0] for parts in sections.sub_indices.values() if parts[0].line < line]
    if early:
        findings.add(SUB_BEFORE_PARENT, early[0].line, f"[{early[0].name}] stands before [{index:04X}]")
    if not entries:
        findings.add(NO_SUB_INDICES, line, f"[{index:04X}] has neither sub-indices nor CompactSubObj")
        return
    count = len(sections.sub_indices)
    given = number_key(values, "subnumber", 0, 0xFF, findings)
    if given is not None and count and given != count:
        text = f"SubNumber={given}, but the file has {count} sub-indices"
        findings.add(SUB_NUMBER, values["subnumber"].line, text)
