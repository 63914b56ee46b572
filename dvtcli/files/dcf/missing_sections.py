"""PDO parameters that an EDS describes in one word, CompactPDO: a DCF that says what they hold gives them sections.

Does not know what else is in a file.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from dvtcli.domain.object_dictionary import OdObject
from dvtcli.files.dcf.edited_text import EditedText
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import section_values
from dvtcli.files.eds.layout import OBJECT_LISTS, EdsLayout
from dvtcli.files.eds.numbers import read_number, without_comment
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.eds.writer import object_sections

Place = tuple[int, int]
_OPTIONAL, _COUNT = "optionalobjects", "supportedobjects"


def write_missing(eds: EdsFile, text: EditedText, values: Mapping[Place, bytes]) -> dict[Place, str]:
    """Put sections behind the file's last one for objects of *values* that have none; what it cannot say, with why.

    They are named in the list of optional objects, where the file has one.
    """
    left_out: dict[Place, str] = {}
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
        left_out |= {(index, 0): "a list names it, and no section describes it" for index in dropped}
    unknown = {place for place in values if place[0] in added and eds.dictionary.entry(*place) is None}
    return left_out | dict.fromkeys(unknown, "the file does not describe it")


def _with_values(one: OdObject, values: Mapping[Place, bytes], left_out: dict[Place, str]) -> OdObject:
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
    """The indices that the file's lists of objects name."""
    lists = (section_values(layout.device.get(name, ()), Findings()) for name in OBJECT_LISTS)
    indices = (_index(value.value) for keys in lists for key, value in keys.items() if key.isdecimal())
    return {index for index in indices if index is not None}


def _write_list(
    layout: EdsLayout, text: EditedText, name: str, known: Collection[int], added: Sequence[int]
) -> list[int]:
    """Name *added* at the end of the list *name*, and drop from it what is not *known* by a section; what was dropped.

    Whoever reads the file takes it for cut short if its lists name objects to the end that have no section.
    """
    parts = layout.device.get(name)
    if not parts:
        return []
    keys = section_values(parts, Findings())
    counts = [value for key, value in keys.items() if key.replace(" ", "") == _COUNT]
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
    """The index that a row of a list names, None where it is no number."""
    try:
        return read_number(without_comment(value))
    except ValueError:
        return None
