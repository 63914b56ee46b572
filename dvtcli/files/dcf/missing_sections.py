"""PDO parameters that an EDS describes in one word, CompactPDO: a DCF that says what they hold gives them sections.

Does not know what else is in a file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from dvtcli.domain.object_dictionary import OdObject
from dvtcli.files.dcf.edited_text import EditedText
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import section_values
from dvtcli.files.eds.layout import Layout
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.eds.writer import object_sections

Place = tuple[int, int]
_LIST, _COUNT = "optionalobjects", "supportedobjects"


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
    listed = [index for index in added if index in eds.dictionary]
    _list(eds.layout, text, listed)
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


def _list(layout: Layout, text: EditedText, added: Sequence[int]) -> None:
    """Name *added* at the end of the list of optional objects, and count them."""
    parts = layout.device.get(_LIST)
    if not parts or not added:
        return
    keys = section_values(parts, Findings())
    rows = [value for key, value in keys.items() if key != _COUNT]
    last = max((value.line for value in keys.values()), default=parts[-1].line)
    for number, index in enumerate(added, len(rows) + 1):
        text.insert_key(last, str(number), f"0x{index:04X}")
    if _COUNT in keys:
        text.set_value(keys[_COUNT].line, str(len(rows) + len(added)))
