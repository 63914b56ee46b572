"""Sort the sections of an EDS or DCF by name: device sections, objects, sub-indices, compact tables.

See CiA 306, 4.5 to 4.8.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from dvtcli.files.eds.findings import DUPLICATE_SECTION, NOT_UNDERSTOOD, Findings
from dvtcli.files.eds.ini import IniSection, IniText

#: The lists of objects, in the standard's order.
OBJECT_LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")

_OBJECT = re.compile(
    r"([0-9a-f]{4})(?:sub[0-9a-f]{1,2}|(name|value|denotation|objectlinks))?", re.IGNORECASE | re.ASCII
)
_DEVICE = {"fileinfo", "deviceinfo", "dummyusage", "comments", "devicecomissioning", *OBJECT_LISTS}
#: Sections that say nothing of the dictionary: data types, dynamic channels, tools (CiA 306, 4.6.1, 4.7 and 4.9).
_KEPT = re.compile(r"standarddatatypes|dynamicchannels|tools|tool[0-9]+", re.ASCII)
#: Sections of modular devices (CiA 306, 4.8 and 5.4): the module's number, and which of its sections.
_MODULES = re.compile(
    r"supportedmodules|connectedmodules"
    r"|m([0-9]{1,3})(moduleinfo|comments|fixedobjects|subextends|(?:fixed|subext)[0-9a-f]{4}(?:sub[0-9a-f]{1,2}"
    r"|name|value|denotation|objectlinks)?)",
    re.ASCII,
)
#: CiA 306 spells it with one m; some tools correct the spelling.
_SAME = {"devicecommissioning": "devicecomissioning"}

#: All parts of a repeated section, in order; nearly always one.
Parts = list[IniSection]


@dataclass(slots=True)
class ObjectSections:
    """An object's sections: *own*, by sub-index, tables of a compact object, and *links* to other objects."""

    own: Parts = field(default_factory=list)
    sub_indices: dict[int, Parts] = field(default_factory=dict)
    names: Parts = field(default_factory=list)
    values: Parts = field(default_factory=list)
    denotations: Parts = field(default_factory=list)
    links: Parts = field(default_factory=list)

    @property
    def line(self) -> int:
        """The object's first line: of its own section, else of its first sub-index."""
        return self.own[0].line if self.own else min(parts[0].line for parts in self.sub_indices.values())

    def each(self) -> Iterator[Parts]:
        """Iterate over every section with its repetitions."""
        yield from (self.own, self.names, self.values, self.denotations, self.links)
        yield from self.sub_indices.values()


@dataclass(slots=True)
class EdsLayout:
    """A file's sections by meaning, *objects* by index only; *stray* sections have no known meaning.

    *modules* are the sections of a modular device by name in lower case; *kept* say nothing of the dictionary.
    """

    device: dict[str, Parts] = field(default_factory=dict)
    objects: dict[int, Parts] = field(default_factory=dict)
    modules: dict[str, Parts] = field(default_factory=dict)
    kept: dict[str, Parts] = field(default_factory=dict)
    stray: Parts = field(default_factory=list)

    @property
    def recognised(self) -> bool:
        """Whether the file has any section of an EDS."""
        return bool(self.objects or self.device.keys() - {"comments"})

    def object_sections(self, index: int) -> ObjectSections:
        """Return the sections of the existing object *index*, sorted by content."""
        found = ObjectSections()
        for section in self.objects[index]:
            name = section.name[4:].lower()
            if not name:
                found.own.append(section)
            elif name.startswith("sub"):
                found.sub_indices.setdefault(int(name[3:], 16), []).append(section)
            else:
                tables = {"name": found.names, "value": found.values, "denotation": found.denotations}
                tables.get(name, found.links).append(section)
        return found


def object_place(name: str) -> tuple[int, int | None] | None:
    """Return index and sub-index (None: the object) of the section *name*; None for other sections."""
    if _OBJECT.fullmatch(name) is None:
        return None
    sub = name[7:] if name[4:7].lower() == "sub" else ""
    return int(name[:4], 16), int(sub, 16) if sub else None


def lay_out(text: IniText) -> EdsLayout:
    """Sort a file's sections by meaning; names in any case."""
    layout = EdsLayout()
    objects, match_object = layout.objects, _OBJECT.fullmatch
    described = set()
    for section in text.sections:
        found = match_object(section.name)
        if found is None:
            _add_device_section(layout, section)
            continue
        digits, table = found.groups()
        index = int(digits, 16)
        if table is None:
            described.add(index)
        if index in objects:
            objects[index].append(section)
        else:
            objects[index] = [section]
    # A table whose object the file does not have tells us nothing.
    for index in objects.keys() - described:
        layout.stray += objects.pop(index)
    return layout


def _add_device_section(layout: EdsLayout, section: IniSection) -> None:
    name = section.name.lower()
    name = _SAME.get(name, name)
    if name in _DEVICE:
        layout.device.setdefault(name, []).append(section)
    elif _MODULES.fullmatch(name):
        layout.modules.setdefault(name, []).append(section)
    elif _KEPT.fullmatch(name):
        layout.kept.setdefault(name, []).append(section)
    else:
        layout.stray.append(section)


def report_stray(layout: EdsLayout, findings: Findings) -> None:
    """Report a note for each unknown section; its text is kept."""
    for section in layout.stray:
        kind = "belongs to no object in this file" if _OBJECT.fullmatch(section.name) else "is not known here"
        findings.add(NOT_UNDERSTOOD, section.line, f"section [{section.name}] {kind}: not understood, kept as it is")


def report_repeated(every: Iterable[Parts], findings: Findings, *, have_values: bool = False) -> None:
    """Report a warning for each repeated section; *have_values*: the section contains values."""
    for parts in every:
        for part in parts[1:]:
            text = f"[{part.name}] is in line {parts[0].line} too; where both have a key, the later one counts"
            findings.add(DUPLICATE_SECTION, part.line, text, value_unread=have_values)
