"""Which section of an EDS or DCF is what: device sections, objects, sub-indices, compact tables.

Knows section names (CiA 306, 4.5 to 4.8). Does not look into a section.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from dvtcli.formats.eds_findings import NOT_UNDERSTOOD, Findings
from dvtcli.formats.eds_text import IniSection, IniText

#: The lists of objects, in the standard's order.
OBJECT_LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")

_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2})|(name|value))?", re.IGNORECASE)
_DEVICE = {"fileinfo", "deviceinfo", "dummyusage", "comments", "devicecomissioning", *OBJECT_LISTS}
#: CiA 306 spells it with one m; some tools correct that.
_SAME = {"devicecommissioning": "devicecomissioning"}

#: Every part of a section that occurs more than once, in the file's order; nearly always one.
Parts = list[IniSection]


@dataclass(slots=True)
class Layout:
    """A file's sections by meaning; *stray* holds those without one."""

    device: dict[str, Parts] = field(default_factory=dict)
    objects: dict[int, Parts] = field(default_factory=dict)
    sub_indices: dict[int, dict[int, Parts]] = field(default_factory=dict)
    names: dict[int, Parts] = field(default_factory=dict)
    values: dict[int, Parts] = field(default_factory=dict)
    stray: Parts = field(default_factory=list)

    @property
    def recognised(self) -> bool:
        """Whether anything in the file makes it an EDS."""
        return bool(self.objects or self.sub_indices or self.device.keys() - {"comments"})

    def indices(self) -> set[int]:
        """Every index that a section describes."""
        return self.objects.keys() | self.sub_indices.keys()

    def line(self, index: int) -> int:
        """The line where object *index* begins: its own section, else the first of its sub-indices."""
        if index in self.objects:
            return self.objects[index][0].line
        return min(parts[0].line for parts in self.sub_indices[index].values())


def lay_out(text: IniText) -> Layout:
    """Sort a file's sections by meaning; names in any case."""
    layout = Layout()
    match_object = _OBJECT.fullmatch
    for section in text.sections:
        found = match_object(section.name)
        if found is None:
            _add_device_section(layout, section)
            continue
        digits, sub_index, table = found.groups()
        index = int(digits, 16)
        if sub_index:
            layout.sub_indices.setdefault(index, {}).setdefault(int(sub_index, 16), []).append(section)
        elif table is None:
            layout.objects.setdefault(index, []).append(section)
        else:
            (layout.names if table.lower() == "name" else layout.values).setdefault(index, []).append(section)
    _move_orphans(layout)
    return layout


def _add_device_section(layout: Layout, section: IniSection) -> None:
    name = section.name.lower()
    name = _SAME.get(name, name)
    if name in _DEVICE:
        layout.device.setdefault(name, []).append(section)
    else:
        layout.stray.append(section)


def _move_orphans(layout: Layout) -> None:
    """A `[xxxxName]` or `[xxxxValue]` whose object the file does not have tells us nothing."""
    known = layout.indices()
    for tables in (layout.names, layout.values):
        for index in tables.keys() - known:
            layout.stray += tables.pop(index)


def report_stray(layout: Layout, findings: Findings) -> None:
    """One note for each section that was not understood; its text is kept."""
    for section in layout.stray:
        kind = "belongs to no object in this file" if _OBJECT.fullmatch(section.name) else "is not known here"
        findings.note(section.line, NOT_UNDERSTOOD, f"section [{section.name}] {kind}: not understood, kept as it is")


def report_repeated(layout: Layout, findings: Findings) -> None:
    """A warning for each section that occurs again."""
    for parts in _all_parts(layout):
        for part in parts[1:]:
            findings.warning(
                part.line,
                "duplicate-section",
                f"[{part.name}] stands in line {parts[0].line} too; where both have a key, the later one counts",
            )


def _all_parts(layout: Layout) -> Iterator[Parts]:
    for table in (layout.device, layout.objects, layout.names, layout.values):
        yield from table.values()
    for sub_indices in layout.sub_indices.values():
        yield from sub_indices.values()
