"""Write the values of one device into an EDS or a DCF; all other bytes stay unchanged (CiA 306)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

from dvtcli.domain.datatypes import DataType
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, OdObject
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.standard_objects import is_pdo_mapping
from dvtcli.domain.text import safe
from dvtcli.errors import InputFileError
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import EditedText, IniValue, Values, section_values
from dvtcli.files.eds.numbers import is_text, number_key, read_number, same_value, text_of, without_comment
from dvtcli.files.eds.reader import EdsFile, parse_eds
from dvtcli.files.eds.sections import OBJECT_LISTS, EdsLayout, ObjectSections, Parts
from dvtcli.files.eds.writer import object_sections
from dvtcli.files.file_info import write_device_keys

_OPTIONAL, _SUPPORTED_COUNT = "optionalobjects", "supportedobjects"


def write_missing(eds: EdsFile, text: EditedText, values: Mapping[ObjectAddress, bytes]) -> dict[ObjectAddress, str]:
    """Append sections for objects of *values* without a section; returns impossible objects with reasons.

    The list of optional objects gets the new objects, if the file has this list.
    """
    left_out: dict[ObjectAddress, str] = {}
    added = sorted({index for index, _ in values} - eds.layout.objects.keys())
    for index in added:
        if index in eds.dictionary:
            for section in object_sections(_with_values(eds.dictionary[index], values, left_out)):
                text.insert(text.last_line, ["", *section.split("\n")])
    described = {index for index in added if index in eds.dictionary}
    unnamed = sorted(described - _named(eds.layout))
    for name in OBJECT_LISTS:
        known = eds.layout.objects.keys() | described
        dropped = _write_list(eds.layout, text, name, known, unnamed if name == _OPTIONAL else ())
        left_out |= {(index, 0): "it is in a list, but has no section" for index in dropped}
    unknown = {place for place in values if place[0] in added and eds.dictionary.entry(*place) is None}
    return left_out | dict.fromkeys(unknown, "the file does not describe it")


def _with_values(one: OdObject, values: Mapping[ObjectAddress, bytes], left_out: dict[ObjectAddress, str]) -> OdObject:
    entries = {}
    for sub_index, entry in one.entries.items():
        data = values.get((one.index, sub_index))
        size = None if entry.data_type is None else entry.data_type.size
        if data is not None and size != len(data):
            left_out[one.index, sub_index] = f"the device holds {len(data)} bytes, not {size}"
            data = None
        entries[sub_index] = replace(entry, value=data)
    return replace(one, entries=entries)


def _named(layout: EdsLayout) -> set[int]:
    """Return the indices in the file's lists of objects."""
    lists = (section_values(layout.device.get(name, ()), Findings()) for name in OBJECT_LISTS)
    indices = (_index(value.value) for keys in lists for key, value in keys.items() if key.isdecimal())
    return {index for index in indices if index is not None}


def _write_list(
    layout: EdsLayout, text: EditedText, name: str, known: Collection[int], added: Sequence[int]
) -> list[int]:
    """Append *added* to the list *name*; drop and return indices without a section (not *known*).

    Readers take a file for cut short if its lists end with objects without a section.
    """
    parts = layout.device.get(name)
    if not parts:
        return []
    keys = section_values(parts, Findings())
    counts = [value for key, value in keys.items() if key.replace(" ", "") == _SUPPORTED_COUNT]
    rows = [value for key, value in keys.items() if key.isdecimal()]  # other keys are whoever wrote them's
    kept = [row for row in rows if (index := _index(row.value)) is None or index in known]
    dropped = [index for row in rows if (index := _index(row.value)) is not None and index not in known]
    if not (dropped or added):
        return []
    if dropped:  # those behind them move up: the numbers of a list have no gap
        for row, value in zip(rows, kept, strict=False):
            text.set_value(row.line, without_comment(value.value))
        for row in rows[len(kept) :]:
            text.remove(row.line)
    last = max((value.line for value in keys.values()), default=parts[-1].line)
    for number, index in enumerate(added, len(kept) + 1):
        text.insert_key(last, str(number), f"0x{index:04X}")
    for count in counts:
        text.set_value(count.line, str(len(kept) + len(added)))
    return dropped


def _index(value: str) -> int | None:
    """Return the index in a row of a list, None if the row is not a number."""
    try:
        return read_number(without_comment(value))
    except ValueError:
        return None


_COUNT = "nrofentries"


class ValueTable:
    """The value table of the object of *sections* in *text*; changes take effect with `write`."""

    def __init__(self, text: EditedText, sections: ObjectSections) -> None:
        self._text, self._sections = text, sections
        self._keys = section_values(sections.values, Findings())
        #: by sub-index
        self.rows: dict[int, IniValue] = dict(_rows(self._keys))
        self._wanted: dict[int, str] = {}
        self._taken_out: set[int] = set()

    def set(self, sub_index: int, value: str, *, is_text: bool) -> None:
        """Set the row of *sub_index* to *value*."""
        if sub_index in self.rows:
            self._text.set_value(self.rows[sub_index].line, value, is_text=is_text)
        else:
            self._wanted[sub_index] = value

    def remove(self, sub_index: int) -> None:
        """Remove the row of *sub_index*."""
        if sub_index in self.rows:
            self._text.remove(self.rows[sub_index].line)
            self._taken_out.add(sub_index)

    def write(self) -> None:
        """Insert the new rows in order, and update their count."""
        if not self._sections.values:
            if self._wanted:
                self._text.insert(self._end_of_object(), ["", *self._new_table()])
            return
        if self._wanted or self._taken_out:
            self._count()
        first = self._keys[_COUNT].line if _COUNT in self._keys else self._sections.values[-1].line
        for sub_index, value in sorted(self._wanted.items()):
            before = [row.line for number, row in self.rows.items() if number < sub_index]
            self._text.insert_key(max([first, *before]), str(sub_index), value)

    def _new_table(self) -> list[str]:
        rows = [f"{sub_index}={value}" for sub_index, value in sorted(self._wanted.items())]
        return [f"[{self._sections.own[0].name}Value]", f"NrOfEntries={len(rows)}", *rows]

    def _count(self) -> None:
        count = str(len(self._keys) - (_COUNT in self._keys) - len(self._taken_out) + len(self._wanted))
        if _COUNT not in self._keys:
            self._text.insert_key(self._sections.values[-1].line, "NrOfEntries", count)
        else:
            self._text.set_value(self._keys[_COUNT].line, count)

    def _end_of_object(self) -> int:
        """The last non-empty line of the object's sections."""
        last = max((part for parts in self._sections.each() for part in parts), key=lambda part: part.line)
        lines = last.text.split("\n")
        return last.line + max(number for number, line in enumerate(lines) if not number or line.strip())


def _rows(keys: Values) -> list[tuple[int, IniValue]]:
    found = []
    for key, row in keys.items():
        try:
            found.append((read_number(row.key), row)) if key != _COUNT else None
        except ValueError:
            continue  # the reader says so
    return found


#: maximum length of a DOMAIN or OCTET_STRING in a line (bytes)
MOST_OCTETS = 1 << 16


def value_text(data_type: DataType | None, data: bytes, like: str = "") -> str:
    """Return *data* of *data_type* as text; hexadecimal if *like*, an earlier value of the object, is.

    Raises ValueError, with the reason as text, if no text represents *data*.
    """
    if data_type is None:
        raise ValueError("its data type is unknown")
    if not data:
        raise ValueError("it is empty")
    if len(data) > MOST_OCTETS:
        raise ValueError(f"it has {len(data):,} bytes, more than {MOST_OCTETS:,}")
    if data_type.size is not None and len(data) != data_type.size:
        raise ValueError(f"the device holds {len(data)} bytes, and a {data_type.name} has {data_type.size}")
    text = text_of(data_type, data, hexadecimal="0x" in like.lower() or "$" in like, exact=False)
    if text is None:
        raise ValueError(f"no line of a file can say this {data_type.name}")
    return text


_VALUE, _DEFAULT = "parametervalue", "defaultvalue"


@dataclass(frozen=True, slots=True)
class Commissioned:
    """The device of a DCF: contents of [DeviceComissioning] and [FileInfo].

    *file_name* is the DCF's name, *made* the time of reading; *bit_rate_kbit*, *serial* (0x1018:4) and *revision*
    (0x1018:3) are None if unknown.
    """

    file_name: str
    node_id: int
    made: datetime
    bit_rate_kbit: int | None = None
    serial: int | None = None
    revision: int | None = None


@dataclass(frozen=True, slots=True)
class DcfText:
    """A DCF as bytes; *said* are the objects with a value in the file, *left_out* the others with their reasons."""

    data: bytes
    said: tuple[ObjectAddress, ...] = ()
    left_out: Mapping[ObjectAddress, str] = field(default_factory=dict)


def write_dcf(data: bytes, source: str, values: Mapping[ObjectAddress, bytes], device: Commissioned) -> DcfText:
    """Return the EDS or DCF *data* (named *source*) with a ParameterValue for each of *values*.

    *values* go by index and sub-index. An existing ParameterValue keeps its text if the value is equal, and is removed
    if *values* have none. Raises InputFileError if *data* is not an EDS or DCF, or no value can be written.
    """
    eds = parse_eds(data, source)
    writer = DcfWriter(eds, EditedText(data), values, device.node_id)
    for index in eds.layout.objects:
        writer.write_object(index)
    writer.left_out |= write_missing(eds, writer.text, values)
    write_device_keys(eds, writer.text, source, device)
    made = writer.text.to_bytes()
    said = tuple(place for place in values if place not in writer.left_out)
    wanted = {place: values[place] for place in said}
    refuse_unlike_values(parse_eds(made, device.file_name).dictionary, wanted, device.node_id)
    return DcfText(made, said, writer.left_out)


def refuse_unlike_values(made: ObjectDictionary, values: Mapping[ObjectAddress, bytes], node_id: int) -> None:
    """Raise InputFileError if the new file, read back as *made*, differs from *values* of *node_id*."""
    for (index, sub_index), data in values.items():
        entry = made.entry(index, sub_index)
        if entry is None or not same_value(entry.data_type, entry.initial(node_id), data):
            raise InputFileError(
                f"{index:04X}:{sub_index:02X} does not read back as it was written into {made.source}",
                place=made.source if entry is None else made.place(entry),
                why="the file describes it in a way that this cannot change",
            )


@dataclass(slots=True)
class DcfWriter:
    """Writes values into *text*, the text of *eds*."""

    eds: EdsFile
    text: EditedText
    values: Mapping[ObjectAddress, bytes]
    node_id: int
    left_out: dict[ObjectAddress, str] = field(default_factory=dict)

    def write_object(self, index: int) -> None:
        """Write every sub-index: in its own section, in the object's table if it has a row, or in a new section."""
        sections = self.eds.layout.object_sections(index)
        own = section_values(sections.own, Findings())
        is_short = bool(number_key(own, "compactsubobj", 0, 254, Findings()))
        if is_short and _VALUE in own:  # of all its sub-indices at once
            self._remove(sections.own)
        table = ValueTable(self.text, sections)
        for sub_index, entry in self.eds.dictionary[index].entries.items():
            has_row, wanted = sub_index in table.rows, self.values.get((index, sub_index))
            if has_row or (is_short and sub_index not in sections.sub_indices):
                self._write_row(entry, table, wanted, _default(own))
            if not has_row or wanted is None:
                parts = sections.sub_indices.get(sub_index, [] if is_short else sections.own)
                self._write_key(entry, parts, wanted) if parts else None
        table.write()

    def _write_key(self, entry: OdEntry, parts: Parts, wanted: bytes | None) -> None:
        """Write the ParameterValue in an object's section; *parts* are the section's repetitions."""
        keys = section_values(parts, Findings())
        given = keys.get(_VALUE)
        if given is not None and wanted is not None and self._is_said(entry, wanted):
            return
        text = None if wanted is None else self._text_of(entry, wanted, given.value if given else _default(keys))
        if given is not None and text:
            self.text.set_value(given.line, text, is_text=is_text(entry.data_type))
        elif given is not None:
            self._remove(parts)
        elif text:
            self.text.insert_key(_anchor(keys, parts), "ParameterValue", text)

    def _write_row(self, entry: OdEntry, table: ValueTable, wanted: bytes | None, default: str) -> None:
        """Write the row of an object in short form; the count needs no row if the other rows imply it."""
        sub_index = entry.sub_index
        row = table.rows.get(sub_index)
        is_told = wanted is not None and not sub_index and same_value(entry.data_type, wanted, self._count(entry.index))
        if wanted is None or is_told:
            table.remove(sub_index)
        elif row is None or not self._is_said(entry, wanted):
            text = self._text_of(entry, wanted, row.value if row else default)
            if text:
                table.set(sub_index, text, is_text=is_text(entry.data_type))
            else:
                table.remove(sub_index)

    def _is_said(self, entry: OdEntry, wanted: bytes) -> bool:
        """Whether the file's ParameterValue means *wanted*, whatever the default."""
        now = replace(entry, default=None).initial(self.node_id)
        return now is not None and same_value(entry.data_type, now, wanted)

    def _count(self, index: int) -> bytes | None:
        """Return the implied value of sub-index 0 of an object in short form without a row for it."""
        entries = self.eds.dictionary[index].entries
        if not is_pdo_mapping(index):
            return entries[0].default
        held = [self.values.get((index, sub)) or entries[sub].default for sub in sorted(entries) if sub]
        if all(data is None for data in held):
            return None
        return bytes([next((n for n, data in enumerate(held) if data is None or not any(data)), len(held))])

    def _text_of(self, entry: OdEntry, wanted: bytes, like: str) -> str | None:
        """Return the text for *wanted*; records the reason and returns None if no text represents it."""
        try:
            text = value_text(entry.data_type, wanted, like)
            if safe(text) != text:
                raise ValueError("it has characters that steer a terminal")
            if not self.text.can_hold(text):
                raise ValueError("the file's encoding lacks some of its characters")
        except ValueError as why:
            self.left_out[entry.index, entry.sub_index] = str(why)
            return None
        return text

    def _remove(self, parts: Parts) -> None:
        """Remove every ParameterValue of a section: readers take the last."""
        for part in parts:
            for number, line in enumerate(part.text.split("\n")[1:], part.line + 1):
                if line.partition("=")[0].strip().lower() == _VALUE:
                    self.text.remove(number)


def _default(keys: Values) -> str:
    return keys[_DEFAULT].value if _DEFAULT in keys else ""


def _anchor(keys: Values, parts: Parts) -> int:
    """The line behind which a ParameterValue goes: DefaultValue, else the last key, else the header."""
    if _DEFAULT in keys:
        return keys[_DEFAULT].line
    return max((value.line for value in keys.values()), default=parts[-1].line)


def change_values(data: bytes, source: str, values: Mapping[ObjectAddress, bytes], node_id: int) -> DcfText:
    """Return the DCF *data* (named *source*) with those of *values* that it does not mean already.

    *values* of *node_id* go by index and sub-index. Sections of other objects, and those about the device and the file,
    stay byte for byte. Raises InputFileError if *data* is no DCF, or no value can be written.
    """
    eds = parse_eds(data, source)
    places = {(index, sub) for index in eds.layout.objects for sub in eds.dictionary[index].entries}
    left_out = dict.fromkeys(values.keys() - places, "no section describes it")
    told: dict[ObjectAddress, bytes] = {}
    changes: dict[ObjectAddress, bytes] = {}
    for index, sub_index in places:
        entry = eds.dictionary[index].entries[sub_index]
        value = replace(entry, default=None).initial(node_id)
        if value is not None:
            told[index, sub_index] = value
        wanted = values.get((index, sub_index))
        if wanted is not None and not same_value(entry.data_type, entry.initial(node_id), wanted):
            changes[index, sub_index] = wanted
    writer = DcfWriter(eds, EditedText(data), told | changes, node_id, left_out)
    for index in sorted({index for index, _ in changes}):
        writer.write_object(index)
    made = writer.text.to_bytes()
    said = {place: value for place, value in (told | dict(values)).items() if place not in writer.left_out}
    refuse_unlike_values(parse_eds(made, source).dictionary, said, node_id)
    return DcfText(made, tuple(changes), writer.left_out)
