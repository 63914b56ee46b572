"""Objects that the modules of a modular device add (CiA 306, 4.8 and 5.4).

Each connected module appends sub-indices to the objects of its `MxSubExtends`, and brings its `MxFixedObjects`. An
object that has its own sections in the file is taken as they say.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from dvtcli.domain.datatypes import U8
from dvtcli.domain.object_dictionary import Access, ObjectType, OdEntry, OdObject
from dvtcli.files.eds.entry import EntryPlace, read_entry
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import Values, section_values
from dvtcli.files.eds.keys import number_key, text_key
from dvtcli.files.eds.layout import EdsLayout, ObjectSections, Parts
from dvtcli.files.eds.numbers import read_number, without_comment

Build = Callable[[], OdObject]
_SUB_EXTENSION = re.compile(r"m([0-9]+)subext([0-9a-f]{4})")
_INFO = re.compile(r"m([0-9]+)moduleinfo")
_FIXED = re.compile(r"m([0-9]+)fixed([0-9a-f]{4})")
_MOST_SUB_INDICES = 254


def connected_modules(layout: EdsLayout) -> list[int]:
    """Return the modules of [ConnectedModules] in their order, each the number of a supported module."""
    values = section_values(layout.modules.get("connectedmodules", ()), Findings())
    rows = sorted((int(key), row.value) for key, row in values.items() if key.isdecimal())
    found = []
    for _, text in rows:
        try:
            found.append(read_number(without_comment(text)))
        except ValueError:
            continue  # a module that nobody knows adds nothing
    return found


def module_names(layout: EdsLayout) -> dict[int, str]:
    """Return the names of the supported modules by number."""
    found: dict[int, str] = {}
    for name, parts in layout.modules.items():
        if (info := _INFO.fullmatch(name)) is not None:
            found[int(info[1])] = text_key(section_values(parts, Findings()), "productname")
    return dict(sorted(found.items()))


def added_by_modules(layout: EdsLayout) -> frozenset[int]:
    """Return the indices that modules of the file may add, connected or not."""
    names = (pattern.fullmatch(name) for name in layout.modules for pattern in (_SUB_EXTENSION, _FIXED))
    return frozenset(int(found[2], 16) for found in names if found)


def module_objects(layout: EdsLayout, build: Callable[[int, ObjectSections], OdObject]) -> dict[int, Build]:
    """Return the objects of the connected modules by index; *build* makes one of its sections."""
    connected = connected_modules(layout)
    found: dict[int, Build] = {}
    for module in dict.fromkeys(connected):
        for index in sorted(_indices(layout, _FIXED, module)):
            found[index] = partial(build, index, _fixed_sections(layout, module, index))
    extended = dict.fromkeys(
        index for module in connected for index in sorted(_indices(layout, _SUB_EXTENSION, module))
    )
    for index in extended:
        parts = [
            layout.modules[name] for module in connected if (name := f"m{module}subext{index:04x}") in layout.modules
        ]
        found[index] = partial(_extended, index, parts)
    return {index: made for index, made in found.items() if index not in layout.objects}


def _indices(layout: EdsLayout, pattern: re.Pattern[str], module: int) -> Iterator[int]:
    for name in layout.modules:
        found = pattern.fullmatch(name)
        if found and int(found[1]) == module:
            yield int(found[2], 16)


def _fixed_sections(layout: EdsLayout, module: int, index: int) -> ObjectSections:
    head = f"m{module}fixed{index:04x}"
    sections = ObjectSections(own=layout.modules[head])
    for name, parts in layout.modules.items():
        if name.startswith(f"{head}sub"):
            sections.sub_indices[int(name.removeprefix(f"{head}sub"), 16)] = parts
    return sections


def _extended(index: int, each: list[Parts]) -> OdObject:
    """Build the ARRAY *index* of the extensions *each* of a connected module, sub-indices from 1 in their order."""
    entries: dict[int, OdEntry] = {}
    name = f"{index:04X}"
    for parts in each:
        values = section_values(parts, Findings())
        name = text_key(values, "parametername") or name
        for _ in range(_count(values)):
            sub_index = len(entries) + 1
            if sub_index > _MOST_SUB_INDICES:
                break
            place = EntryPlace(index, sub_index, parts[0].line, of_many=True)
            member = read_entry(values, place, Findings())
            entries[sub_index] = replace(member, name=f"{name} {sub_index}")
    line = each[0][0].line
    head = OdEntry(
        index, 0, "Number of entries", U8, Access.RO, pdo_mapping=False, default=bytes([len(entries)]), line=line
    )
    return OdObject(index, name, ObjectType.ARRAY, {0: head, **entries}, line)


def _count(values: Values) -> int:
    """Return how many sub-indices a module adds; 1 unless said."""
    return number_key(values, "count", 0, _MOST_SUB_INDICES, Findings()) or 1
