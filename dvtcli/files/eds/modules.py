"""Objects that the modules of a modular device add (CiA 306, 4.8 and 5.4).

Each connected module appends sub-indices to the objects of its `MxSubExtends`, and brings its `MxFixedObjects`. Of a
file that says itself what is connected, objects with sections of their own are as these say. The module list (0x1027)
holds the connected modules.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from dvtcli.domain.datatypes import U8, U16
from dvtcli.domain.object_dictionary import Access, Modules, ObjectType, OdEntry, OdObject
from dvtcli.domain.objects import MODULE_LIST
from dvtcli.files.eds.entry import EntryPlace, read_entry
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import EditedText, Values, section_values, split_sections
from dvtcli.files.eds.numbers import number_key, read_number, text_key, without_comment
from dvtcli.files.eds.sections import EdsLayout, ObjectSections, Parts

Build = Callable[[], OdObject]
#: numbers of modules: 0x1027 has 16 bits for each
MODULE_NUMBERS = range(1, 0x10000)
_SUB_EXTENSION = r"m([0-9]+)subext([0-9a-f]{4})"
_INFO = r"m([0-9]+)moduleinfo"
_FIXED = r"m([0-9]+)fixed([0-9a-f]{4})"
_OF_MODULE = r"m([0-9]+)[a-z]"
_CONNECTED = "connectedmodules"
_OF_MANY_ENTRIES = (ObjectType.ARRAY, ObjectType.RECORD)
_BITS_OF_BYTE = 8
_MOST_SUB_INDICES = 254


def with_modules(data: bytes, modules: Sequence[int]) -> bytes:
    """Return the EDS or DCF *data* with *modules* as its [ConnectedModules], at its end."""
    text = EditedText(data)
    for section in split_sections(data).sections:
        if section.name.lower() == _CONNECTED:
            for line in range(section.line, section.line + section.text.count("\n") + 1):
                text.remove(line)
    rows = (f"{number}={module}" for number, module in enumerate(modules, 1))
    text.insert(text.last_line, ["", "[ConnectedModules]", f"NrOfEntries={len(modules)}", *rows])
    return text.to_bytes()


def modules_of(layout: EdsLayout) -> Modules:
    """Return the modules of a modular device; empty for any other device."""
    return Modules(_supported(layout), tuple(connected_modules(layout))) if layout.modules else Modules()


def connected_modules(layout: EdsLayout) -> list[int]:
    """Return the modules of [ConnectedModules] in their order, each the number of a supported module."""
    values = section_values(layout.modules.get(_CONNECTED, ()), Findings())
    rows = sorted((int(key), row.value) for key, row in values.items() if key.isdecimal())
    found = []
    for _, text in rows:
        try:
            number = read_number(without_comment(text))
        except ValueError:
            continue  # a module that nobody knows adds nothing
        if number in MODULE_NUMBERS:
            found.append(number)
    return found


def _supported(layout: EdsLayout) -> dict[int, str]:
    """Return the names of the supported modules by number; empty for a module without a name."""
    values = section_values(layout.modules.get("supportedmodules", ()), Findings())
    found = dict.fromkeys(range(1, (number_key(values, "nrofentries", 0, _MOST_SUB_INDICES, Findings()) or 0) + 1), "")
    for name, parts in layout.modules.items():
        if (of_module := re.match(_OF_MODULE, name)) is not None:
            found.setdefault(int(of_module[1]), "")
        if (info := re.fullmatch(_INFO, name)) is not None:
            found[int(info[1])] = text_key(section_values(parts, Findings()), "productname")
    return dict(sorted(found.items()))


def added_by_modules(layout: EdsLayout) -> frozenset[int]:
    """Return the indices that modules of the file may add, connected or not."""
    names = (re.fullmatch(pattern, name) for name in layout.modules for pattern in (_SUB_EXTENSION, _FIXED))
    return frozenset(int(found[2], 16) for found in names if found)


def module_objects(
    layout: EdsLayout, build: Callable[[int, ObjectSections], OdObject], *, chosen: bool
) -> dict[int, Build]:
    """Return the objects of the connected modules by index; *build* makes one of its sections.

    *chosen*: the user connects them, and the file has the objects of the device without modules.
    """
    connected = connected_modules(layout)
    found: dict[int, Build] = {}
    for module in dict.fromkeys(connected):
        for index in sorted(_indices(layout, _FIXED, module)):
            found[index] = partial(build, index, _fixed_sections(layout, module, index))
    found = {index: made for index, made in found.items() if index not in layout.objects}
    extended = dict.fromkeys(
        index for module in connected for index in sorted(_indices(layout, _SUB_EXTENSION, module))
    )
    for index in extended:
        parts = [
            layout.modules[name] for module in connected if (name := f"m{module}subext{index:04x}") in layout.modules
        ]
        own = partial(build, index, layout.object_sections(index)) if index in layout.objects else None
        if own is None or chosen:
            found |= _extended_objects(index, parts, own, layout)
    if connected and MODULE_LIST in layout.objects:
        listed = partial(build, MODULE_LIST, layout.object_sections(MODULE_LIST))
        found[MODULE_LIST] = partial(_module_list, listed, connected)
    return found


def _indices(layout: EdsLayout, pattern: str, module: int) -> Iterator[int]:
    for name in layout.modules:
        found = re.fullmatch(pattern, name)
        if found and int(found[1]) == module:
            yield int(found[2], 16)


def _fixed_sections(layout: EdsLayout, module: int, index: int) -> ObjectSections:
    head = f"m{module}fixed{index:04x}"
    sections = ObjectSections(own=layout.modules[head])
    for name, parts in layout.modules.items():
        if name.startswith(f"{head}sub"):
            sections.sub_indices[int(name.removeprefix(f"{head}sub"), 16)] = parts
    return sections


def _extended_objects(index: int, each: list[Parts], own: Build | None, layout: EdsLayout) -> dict[int, Build]:
    """Return the object *index* that the extensions *each* lengthen, and the next ones if it is full (ObjExtend).

    Objects with sections of their own in *layout* stay as these say.
    """
    last = min(filter(None, (_last_sub_index(parts) for parts in each)), default=0)
    if not last:
        return {index: partial(_extended, index, each, own)}
    whole = _extended(index, each, own, most=_MOST_SUB_INDICES * len(each))
    found: dict[int, Build] = {}
    subs = [sub for sub in sorted(whole.entries) if sub] if whole.object_type in _OF_MANY_ENTRIES else []
    for first in range(0, max(len(subs), 1), last):
        at = index + first // last
        if at == index or at not in layout.objects:
            found[at] = partial(_split, whole, at, subs[first : first + last])
    return found


def _split(whole: OdObject, index: int, subs: list[int]) -> OdObject:
    """Return the object *index* with the sub-indices *subs* of *whole*, numbered from 1."""
    if not subs:
        return whole
    name = whole.name if index == whole.index else f"{whole.name} ({index:04X})"
    entries = {
        sub: replace(whole.entries[old], index=index, sub_index=sub, name=whole.entries[old].name)
        for sub, old in enumerate(subs, 1)
    }
    head = replace(whole.entries[0], index=index, default=bytes([len(subs)]))
    return replace(whole, index=index, name=name, entries={0: head, **entries})


def _last_sub_index(parts: Parts) -> int:
    """Return the sub-index after which an extension goes on in the next object (ObjExtend); 0 for none."""
    return number_key(section_values(parts, Findings()), "objextend", 0, _MOST_SUB_INDICES, Findings()) or 0


def _extended(index: int, each: list[Parts], own: Build | None = None, most: int = _MOST_SUB_INDICES) -> OdObject:
    """Build the ARRAY *index* of the extensions *each* of a connected module, in their order, *most* sub-indices.

    They follow the sub-indices of the object's *own* sections, if it has any; a VAR of its own stays one.
    """
    base = own() if own is not None else None
    if base is not None and base.object_type not in _OF_MANY_ENTRIES:
        return base
    entries = {sub: entry for sub, entry in base.entries.items() if sub} if base is not None else {}
    name, bits = base.name if base is not None else f"{index:04X}", 0
    for parts in each:
        values = section_values(parts, Findings())
        name = name if base is not None else text_key(values, "parametername") or name
        member = read_entry(values, EntryPlace(index, 1, parts[0].line, of_many=True), Findings())
        count, more_bits = _added_by(values)
        if more_bits:
            width = (member.data_type.bits if member.data_type is not None else None) or _BITS_OF_BYTE
            count, bits = -(-(bits + more_bits) // width) - -(-bits // width), bits + more_bits
        first = max(entries, default=0) + 1
        for sub_index in range(first, min(first + count, most + 1)):
            entries[sub_index] = replace(member, sub_index=sub_index, name=f"{name} {sub_index}")
    line = base.line if base is not None else each[0][0].line
    head = OdEntry(index, 0, "Number of entries", U8, Access.RO, pdo_mapping=False, line=line)
    if base is not None:
        head = base.entries.get(0, head)
    head = replace(head, default=bytes([min(max(entries, default=0), _MOST_SUB_INDICES)]), value=None)
    if base is not None:
        return replace(base, entries={0: head, **entries})
    return OdObject(index, name, ObjectType.ARRAY, {0: head, **entries}, line)


def _added_by(values: Values) -> tuple[int, int]:
    """Return how many sub-indices a module adds (1 unless said), and its bits if modules share them (`Count=0;2`)."""
    text, _, shared = text_key(values, "count").partition(";")
    try:
        count, bits = read_number(text.strip() or "1"), read_number(shared.strip() or "0")
    except ValueError:
        return 1, 0
    return (0, min(bits, _MOST_SUB_INDICES)) if bits and not count else (min(count, _MOST_SUB_INDICES) or 1, 0)


def _module_list(build: Build, connected: list[int]) -> OdObject:
    """Return the module list (0x1027, CiA 301, 7.5.2.30) with *connected*; values of a DCF stay."""
    held = build()
    like = held.entries.get(1) or OdEntry(MODULE_LIST, 1, "Module", U16, Access.RO, pdo_mapping=False, line=held.line)
    entries = {0: replace(held.entries[0], default=bytes([len(connected)]))} if 0 in held.entries else {}
    for sub_index, module in enumerate(connected[:_MOST_SUB_INDICES], 1):
        known = held.entries.get(sub_index) or replace(
            like, sub_index=sub_index, name=f"Module {sub_index}", value=None
        )
        size = 2 if known.data_type is None else known.data_type.size or 2
        entries[sub_index] = replace(known, default=module.to_bytes(size, "little"))
    return replace(held, entries=entries)
