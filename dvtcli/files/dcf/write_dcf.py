"""An EDS, or an older DCF, with what one device holds: a DCF (CiA 306) that is its file in every other byte.

Knows where the values of objects stand. Does not know a device, nor which of its objects are worth writing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime

from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
from dvtcli.domain.safe_text import safe
from dvtcli.domain.standard_objects import is_pdo_mapping
from dvtcli.errors import InputFileError
from dvtcli.files.dcf.device_keys import write_device_keys
from dvtcli.files.dcf.edited_text import EditedText
from dvtcli.files.dcf.missing_sections import write_missing
from dvtcli.files.dcf.value_table import ValueTable
from dvtcli.files.dcf.value_text import value_text
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import Values, section_values
from dvtcli.files.eds.keys import number_key
from dvtcli.files.eds.layout import Parts
from dvtcli.files.eds.reader import EdsFile, parse_eds
from dvtcli.files.eds.written_values import is_text, same_value

Place = tuple[int, int]
_VALUE, _DEFAULT = "parametervalue", "defaultvalue"


@dataclass(frozen=True, slots=True)
class Commissioned:
    """The device that a DCF is about: what its [DeviceComissioning] and [FileInfo] say.

    *file_name* is the DCF's, *made* when its values were read; *bit_rate_kbit*, *serial* (0x1018:4) and *revision*
    (0x1018:3) are None where nobody knows them.
    """

    file_name: str
    node_id: int
    made: datetime
    bit_rate_kbit: int | None = None
    serial: int | None = None
    revision: int | None = None


@dataclass(frozen=True, slots=True)
class DcfText:
    """A DCF as bytes; *left_out* are the objects that it cannot say, each with why, *said* those that it says."""

    data: bytes
    said: tuple[Place, ...] = ()
    left_out: Mapping[Place, str] = field(default_factory=dict)


def write_dcf(data: bytes, source: str, values: Mapping[Place, bytes], device: Commissioned) -> DcfText:
    """The EDS or DCF *data* (called *source*) with a ParameterValue for each of *values*, by index and sub-index.

    A ParameterValue that the file has already stays as it is written where it means the same, and is taken out where
    *values* have none. InputFileError where the file is none, or nothing can be written into it.
    """
    eds = parse_eds(data, source)
    writer = _Writer(eds, EditedText(data), values, device.node_id)
    for index in eds.layout.objects:
        writer.write_object(index)
    writer.left_out |= write_missing(eds, writer.text, values)
    write_device_keys(eds, writer.text, source, device)
    made = writer.text.to_bytes()
    said = tuple(place for place in values if place not in writer.left_out)
    wanted = {place: values[place] for place in said}
    refuse_unlike_values(parse_eds(made, device.file_name).dictionary, wanted, device.node_id)
    return DcfText(made, said, writer.left_out)


def refuse_unlike_values(made: ObjectDictionary, values: Mapping[Place, bytes], node_id: int) -> None:
    """Raise InputFileError where *made*, a new file as it is read, says something else than *values* of *node_id*."""
    for (index, sub_index), data in values.items():
        entry = made.entry(index, sub_index)
        if entry is None or not same_value(entry.data_type, entry.initial(node_id), data):
            raise InputFileError(
                f"{index:04X}:{sub_index:02X} does not read back as it was written into {made.source}",
                place=made.source if entry is None else made.place(entry),
                why="the file describes it in a way that this cannot change",
            )


@dataclass(slots=True)
class _Writer:
    """What is written into *text*, of which *eds* was read."""

    eds: EdsFile
    text: EditedText
    values: Mapping[Place, bytes]
    node_id: int
    left_out: dict[Place, str] = field(default_factory=dict)

    def write_object(self, index: int) -> None:
        """Every sub-index: in its own section, or in the object's table where it has a row, or no section."""
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
        """The ParameterValue in the section of an object, of which *parts* are the repetitions."""
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
        """The row of an object in short form; its count needs none where the rows tell it."""
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
        """What sub-index 0 of an object in short form is taken for where no row says it."""
        entries = self.eds.dictionary[index].entries
        if not is_pdo_mapping(index):
            return entries[0].default
        held = [self.values.get((index, sub)) or entries[sub].default for sub in sorted(entries) if sub]
        if all(data is None for data in held):
            return None
        return bytes([next((n for n, data in enumerate(held) if data is None or not any(data)), len(held))])

    def _text_of(self, entry: OdEntry, wanted: bytes, like: str) -> str | None:
        """The text for *wanted*; None, and noted, where there is none."""
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
        """Take out every ParameterValue of a section: of several the last one counts."""
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
