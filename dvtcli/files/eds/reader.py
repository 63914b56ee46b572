"""Read EDS and DCF files (CiA 306) in any tool's dialect, and report oddities.

`read_eds` returns quickly: objects are built on first access, and findings on request. Each section is either
understood or reported; `EdsFile.text` keeps the whole text with lines.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path

from dvtcli.domain.datatypes import U8
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.objects import IDENTITY
from dvtcli.domain.standard_objects import PDO_COMMUNICATION, PDO_MAPPING, is_pdo_mapping, standard_entry
from dvtcli.errors import InputFileError
from dvtcli.files.eds.entry import EntryPlace, read_entry, read_value
from dvtcli.files.eds.findings import (
    BAD_LINE,
    COMPACT_COUNT,
    COMPACT_PDO,
    COMPACT_PDO_BITS,
    NO_OBJECT_TYPE,
    NO_PARENT,
    NO_SUB_INDEX,
    NO_SUB_INDICES,
    OBJECT_TYPE,
    SUB_BEFORE_PARENT,
    SUB_INDICES_OF_VAR,
    SUB_NUMBER,
    TABLE_COUNT,
    EdsFinding,
    Findings,
)
from dvtcli.files.eds.ini import MOST_BYTES, IniText, IniValue, Values, section_values, split_sections, too_much
from dvtcli.files.eds.numbers import number_key, quoted, read_number, text_key
from dvtcli.files.eds.sections import (
    EdsLayout,
    ObjectSections,
    Parts,
    check_lists,
    lay_out,
    read_device_info,
    report_repeated,
    report_stray,
)
from dvtcli.files.input_file import read_input_head

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
    """Build sub-index 0: NrOfObjects, UNSIGNED8, *count*, ro (CiA 306, 4.6.3.3) unless CiA 301 makes it rw."""
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
    """Build sub-index 0 of a compact PDO mapping: the number of leading *entries* that map an object.

    CiA 306 sets sub-index 0 to the number of sub-indices, but a mapping holds the number of mapped objects (CiA 301,
    7.5.2.36). None (unknown) if the file has no mapping entry. If ParameterValues set the leading entries without a
    count, the wanted count is their number.
    """
    held = [entry.initial(0) for sub_index, entry in sorted(entries.items()) if sub_index]
    mapped = next((n for n, data in enumerate(held) if data is None or not any(data)), len(held))
    unknown = all(data is None for data in held)
    count, said = entries[0], [sub for sub, entry in entries.items() if sub and entry.value is not None]
    wanted = bytes([mapped]) if count.value is None and said and max(said) <= mapped else count.value
    return replace(count, default=None if unknown else bytes([mapped]), value=wanted)


def compact_pdo_indices(present: set[int], rpdo_count: int, tpdo_count: int) -> list[int]:
    """Return the PDO parameters that CompactPDO adds to those *present*.

    Adds the lowest PDO numbers without a section up to *rpdo_count* RPDOs and *tpdo_count* TPDOs, and the missing half
    of PDOs with only a communication or a mapping section.
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
    """Build the PDO parameter *index* of CompactPDO=*mask*; bit 0..5 set means sub-index 1..6 exists.

    Access and types follow CiA 301; *line* is the line of CompactPDO.
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


def apply_tables(sections: ObjectSections, entries: dict[int, OdEntry], findings: Findings) -> None:
    """Put names, denotations and ParameterValues of the tables into *entries*; a table may lack sub-indices."""
    for sub_index, given in _rows(sections.names, entries, findings):
        if given.value:
            entries[sub_index] = replace(entries[sub_index], name=given.value)
    for sub_index, given in _rows(sections.denotations, entries, findings):
        if given.value:
            entries[sub_index] = replace(entries[sub_index], denotation=given.value)
    said = _own_values(sections)
    for sub_index, given in _rows(sections.values, entries, findings, has_values=True):
        row = given if given.other is not None else given._replace(other=said.get(sub_index))
        said[sub_index] = row
        encoded = read_value(row, entries[sub_index].data_type, findings, is_wanted=True)
        if encoded is not None:
            entries[sub_index] = replace(entries[sub_index], value=encoded.data, value_relative=encoded.relative)


def _own_values(sections: ObjectSections) -> dict[int, IniValue]:
    """Return the ParameterValues in sections of sub-indices, outside the table."""
    if not sections.values:
        return {}
    own = ((sub, section_values(parts, Findings())) for sub, parts in sections.sub_indices.items())
    return {sub: values["parametervalue"] for sub, values in own if "parametervalue" in values}


def _rows(
    parts: Parts, entries: dict[int, OdEntry], findings: Findings, *, has_values: bool = False
) -> Iterator[tuple[int, IniValue]]:
    """Iterate over rows `sub-index=text` of a table for existing sub-indices; reports other rows."""
    if not parts:
        return
    values = section_values(parts, findings)
    count = number_key(values, "nrofentries", 0, 0xFF, findings)
    rows = [value for key, value in values.items() if key != "nrofentries"]
    if count is not None and count != len(rows):
        text = f"NrOfEntries={count}, but [{parts[0].name}] has {len(rows)}"
        findings.add(TABLE_COUNT, values["nrofentries"].line, text)
    for row in rows:
        try:
            sub_index = read_number(row.key)
        except ValueError:
            text = f"{quoted(row)}: {row.key} is not a sub-index; ignored"
            findings.add(BAD_LINE, row.line, text, value_lost=has_values and bool(row.value))
            continue
        if sub_index in entries:
            yield sub_index, row
        else:
            text = f"{quoted(row)}: the object has no such sub-index; ignored"
            findings.add(NO_SUB_INDEX, row.line, text, value_unread=has_values and bool(row.value))


_KNOWN = frozenset(ObjectType)
_OF_ONE_ENTRY = (ObjectType.NULL, ObjectType.DOMAIN, ObjectType.DEFTYPE, ObjectType.VAR)


def build_object(layout: EdsLayout, index: int, findings: Findings) -> OdObject:
    """Build object *index* from its sections, at least one."""
    return _of_sections(index, layout.object_sections(index), findings)


def _of_sections(index: int, sections: ObjectSections, findings: Findings) -> OdObject:
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
    """Return ObjectType, by default VAR (CiA 306, 4.6.3), but never VAR for an object with sub-indices."""
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
    """Report contradictions between an object's section and its sub-indices."""
    line = sections.line
    if not sections.own:
        findings.add(NO_PARENT, line, f"sub-indices, but no section [{index:04X}]")
        return
    early = [parts[0] for parts in sections.sub_indices.values() if parts[0].line < line]
    if early:
        findings.add(SUB_BEFORE_PARENT, early[0].line, f"[{early[0].name}] is before [{index:04X}]")
    if not entries:
        findings.add(NO_SUB_INDICES, line, f"[{index:04X}] has neither sub-indices nor CompactSubObj")
        return
    count = len(sections.sub_indices)
    given = number_key(values, "subnumber", 0, 0xFF, findings)
    if given is not None and count and given != count:
        text = f"SubNumber={given}, but the file has {count} sub-indices"
        findings.add(SUB_NUMBER, values["subnumber"].line, text)


__all__ = ["EdsFile", "EdsFinding", "parse_eds", "read_eds"]

_PDO_SUB_INDICES = 0x3F


@dataclass(frozen=True)
class EdsFile:
    """A parsed file: its *dictionary*, and its whole *text* (sections in order, with lines).

    *first_findings* are those of the device sections; `findings` has all.
    """

    dictionary: ObjectDictionary
    text: IniText
    layout: EdsLayout
    first_findings: tuple[EdsFinding, ...]

    @property
    def node_id(self) -> int | None:
        """The node-ID of a DCF's DeviceComissioning, 1..127, or None."""
        return self.dictionary.info.node_id

    @property
    def sections(self) -> int:
        """How many sections the file has."""
        return len(self.text.sections)

    @property
    def understood(self) -> int:
        """The number of understood sections; the rule `section-not-understood` reports the others."""
        return self.sections - len(self.layout.stray)

    @cached_property
    def findings(self) -> tuple[EdsFinding, ...]:
        """Everything odd in the file, by line; this looks at every section and takes its time."""
        findings = Findings(list(self.first_findings))
        section_values([self.text.preamble], findings)
        report_stray(self.layout, findings)
        for parts in (self.layout.device, self.layout.modules, self.layout.kept):
            report_repeated(parts.values(), findings)
        for name in ("fileinfo", "comments"):
            section_values(self.layout.device.get(name, ()), findings)
        check_lists(self.layout, findings)
        for index in self.layout.objects:
            build_object(self.layout, index, findings)
        return findings.in_order()

    @property
    def lacks_to_its_end(self) -> str:
        """Describe the missing objects of a file that ends too early; empty for a whole file.

        Ends too early: the last object by list order or by index has no section.
        """
        listed = check_lists(self.layout, Findings())
        lacking = set(listed) - self.layout.objects.keys()
        if not listed or lacking.isdisjoint({listed[-1], max(listed)}):
            return ""
        return f"{len(lacking)} of {len(listed)} objects that its lists name have no section, to the last one"

    def values(self, section: str) -> Mapping[str, IniValue]:
        """Return all keys (in lower case) of *section* with value and line; empty if absent."""
        wanted = section.strip().lower()
        parts = [part for part in self.text.sections if part.name.lower() == wanted]
        return section_values(parts, Findings())


def read_eds(path: Path, modules: Sequence[int] | None = None) -> EdsFile:
    """Read the EDS or DCF file at *path*; of a modular device with *modules* connected (None: as the file says).

    Raises InputFileError if the file is not an EDS or DCF, OSError if it cannot be read.
    """
    return parse_eds(read_input_head(path, MOST_BYTES + 1), path.name, modules)


def parse_eds(data: bytes, source: str, modules: Sequence[int] | None = None) -> EdsFile:
    """Parse the bytes of an EDS or DCF file; *source* is its name for messages, *modules* as of `read_eds`.

    Raises InputFileError if *data* has no section of an EDS, or is larger than any device needs.
    """
    return _parsed(data, source, None if modules is None else tuple(modules))


#: nodes of a machine often share a file, and each command of a session reads its files again
@lru_cache(maxsize=8)
def _parsed(data: bytes, source: str, modules: tuple[int, ...] | None) -> EdsFile:
    if excess := too_much(data):
        raise InputFileError(f"{source} is {excess}", place=f"{source}:1", why="an EDS or DCF is some 100 kB")
    text = split_sections(data)
    layout = lay_out(text)
    says_modules = False
    if modules is not None or layout.modules:
        from dvtcli.files.eds.modules import connected_modules, with_modules  # few devices are modular

        says_modules = bool(connected_modules(layout))
        if modules is not None:
            text = split_sections(with_modules(data, modules))
            layout = lay_out(text)
    if not layout.recognised:
        raise _not_an_eds(data, source)
    findings = Findings()
    device = section_values(layout.device.get("deviceinfo", ()), findings)
    identity = _build(layout, IDENTITY) if IDENTITY in layout.objects else None
    info = read_device_info(device, layout, identity, findings)
    objects: dict[int, OdObject | Callable[[], OdObject]] = {
        index: partial(_build, layout, index) for index in layout.objects
    }
    of_modules: dict[int, Callable[[], OdObject]] = {}
    if layout.modules:
        from dvtcli.files.eds.modules import module_objects, modules_of

        info = replace(info, modules=modules_of(layout))
        of_modules = module_objects(
            layout, lambda index, sections: _of_sections(index, sections, Findings()), chosen=not says_modules
        )
        objects |= of_modules
    objects |= _compact_pdos(device, set(objects), info.rpdo_count or 0, info.tpdo_count or 0, findings)
    spelled = partial(_text_of_names, layout, of_modules.keys())
    return EdsFile(ObjectDictionary(objects, info, source, spelled), text, layout, tuple(findings.found))


def _text_of_names(layout: EdsLayout, of_modules: Collection[int], index: int) -> str | None:
    """The text of the sections of *index*, in lower case; None if it has names that no section spells out."""
    if index in of_modules or index not in layout.objects:
        return None
    text = "\n".join(section.text for section in layout.objects[index]).lower()
    return None if "compactsubobj" in text else text


def _build(layout: EdsLayout, index: int) -> OdObject:
    """Build an object on first access; `EdsFile.findings` collects its findings."""
    return build_object(layout, index, Findings())


def _compact_pdos(
    device: Values, present: set[int], rpdo_count: int, tpdo_count: int, findings: Findings
) -> dict[int, Callable[[], OdObject]]:
    mask = number_key(device, "compactpdo", 0, 0xFF, findings)
    if not mask:
        return {}
    line = device["compactpdo"].line
    if mask & ~_PDO_SUB_INDICES:
        findings.add(COMPACT_PDO_BITS, line, f"CompactPDO=0x{mask:02X}: bits above 5 have no meaning; ignored")
    missing = compact_pdo_indices(present, rpdo_count, tpdo_count)
    if missing:
        text = f"CompactPDO: {len(missing)} PDO parameters without a section exist as CiA 301 describes them"
        findings.add(COMPACT_PDO, line, text)
    return {index: partial(compact_pdo_object, index, mask & _PDO_SUB_INDICES, line) for index in missing}


def _not_an_eds(data: bytes, source: str) -> InputFileError:
    if not data.strip():
        why = "the file is empty"
    elif b"\0" in data[:4096]:
        why = "it looks like binary data"
    elif data.lstrip()[:1] == b"<":
        why = "it looks like XML (XDD/XDC?)"
    else:
        why = "it has no section such as [DeviceInfo] or [1000]"
    return InputFileError(f"{source} is not an EDS or DCF file", place=f"{source}:1", why=why)
