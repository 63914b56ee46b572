"""The tables `[xxxxName]` and `[xxxxValue]` that name and set the sub-indices of a compact object.

Knows CiA 306, 4.6.3.3 (compact storage). Does not know how the sub-indices came to be.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.files.eds.entry import read_value
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import IniValue, section_values
from dvtcli.files.eds.keys import number_key, quoted
from dvtcli.files.eds.layout import ObjectSections, Parts
from dvtcli.files.eds.numbers import read_number
from dvtcli.files.eds.read_rules import BAD_LINE, NO_SUB_INDEX, TABLE_COUNT


def apply_tables(sections: ObjectSections, entries: dict[int, OdEntry], findings: Findings) -> None:
    """Put the names and ParameterValues of the tables into *entries*; a table need not mention every sub-index."""
    for sub_index, given in _rows(sections.names, entries, findings):
        if given.value:
            entries[sub_index] = replace(entries[sub_index], name=given.value)
    said = _own_values(sections)
    for sub_index, given in _rows(sections.values, entries, findings, has_values=True):
        row = given if given.other is not None else given._replace(other=said.get(sub_index))
        said[sub_index] = row
        encoded = read_value(row, entries[sub_index].data_type, findings, is_wanted=True)
        if encoded is not None:
            entries[sub_index] = replace(entries[sub_index], value=encoded.data, value_relative=encoded.relative)


def _own_values(sections: ObjectSections) -> dict[int, IniValue]:
    """The ParameterValues that sub-indices have in sections of their own, beside the table."""
    if not sections.values:
        return {}
    own = ((sub, section_values(parts, Findings())) for sub, parts in sections.sub_indices.items())
    return {sub: values["parametervalue"] for sub, values in own if "parametervalue" in values}


def _rows(
    parts: Parts, entries: dict[int, OdEntry], findings: Findings, *, has_values: bool = False
) -> Iterator[tuple[int, IniValue]]:
    """The rows `sub-index=text` of a table whose sub-index exists; the others are reported."""
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
