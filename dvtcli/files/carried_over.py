"""What a conversion of a device's file keeps and loses: texts outside the dictionary, and differences in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from dvtcli.domain.object_dictionary import Commissioning, DeviceInfo, Modules, ObjectDictionary, OdEntry, OdObject
from dvtcli.domain.scaling import parse_offset
from dvtcli.domain.text import join_some, plural
from dvtcli.files.eds import findings
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import IniSection, section_values
from dvtcli.files.eds.keys import OBJECT, Carried, keys_that_are
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.eds.sections import OBJECT_LISTS, object_place
from dvtcli.files.eds.writer import KeptText
from dvtcli.files.xdd import xdd_parameters
from dvtcli.files.xdd.xdd_reader import OWN_CHARACTERISTICS, characteristic

if TYPE_CHECKING:
    from dvtcli.files.xdd.xdd_reader import XddFile
    from dvtcli.files.xdd.xml_tree import XmlElement

#: Sections written anew.
_ANEW = {"fileinfo", "dummyusage", *OBJECT_LISTS}
#: Rules for contents ignored by the reader.
_LEFT_OUT = {
    rule.name
    for rule in (
        findings.BAD_NUMBER, findings.BAD_LINE, findings.BAD_VALUE, findings.UNTYPED_VALUE,
        findings.LIMIT_TYPE, findings.LIMITS_CROSSED, findings.LIMITS_WRAPPED, findings.LIMIT_WITHOUT_SENSE,
        findings.NO_SUB_INDEX, xdd_parameters.MAPPING_WORD, xdd_parameters.MAPPING_DIRECTION,
        xdd_parameters.OBJECT_TWICE, xdd_parameters.NO_INDEX, xdd_parameters.OBJECT_LISTS,
    )
}  # fmt: skip
#: Elements held by the dictionary, or written anew.
_ELEMENTS = {
    "ISO15745ProfileContainer", "ISO15745Profile", "ProfileHeader", "ProfileBody", "DeviceIdentity", "vendorName",
    "vendorID", "productName", "productID", "orderNumber", "ApplicationProcess", "parameterList", "parameter", "label",
    "defaultValue", "actualValue", "denotation", "unit", "allowedValues", "range", "minValue", "maxValue",
    "ApplicationLayers", "CANopenObjectList", "CANopenObject", "CANopenSubObject", "dummyUsage", "dummy",
    "TransportLayers", "PhysicalLayer", "baudRate", "supportedBaudRate", "NetworkManagement", "CANopenGeneralFeatures",
    "CANopenMasterFeatures", "deviceCommissioning", "ISO15745Reference", "ISO15745Part", "ISO15745Edition",
    "DeviceFunction", "capabilities", "characteristicsList",
    "ProfileTechnology", "ProfileIdentification", "ProfileRevision", "ProfileName", "ProfileSource", "ProfileClassID",
}  # fmt: skip
_CONNECTED = "connectedmodules"


def kept(file: EdsFile, *, of_a_node: bool) -> KeptText:
    """Return what an EDS made of *file* keeps beside its dictionary; a DCF also what is *of_a_node*."""
    names = keys_that_are(Carried.KEPT)
    if of_a_node:
        names |= keys_that_are(Carried.KEPT_OF_A_NODE)
    keys: dict[str, dict[str, str]] = {}
    for section in file.text.sections:
        values = section_values([section], Findings())
        found = {given.key: given.value for key, given in values.items() if key in names and given.value}
        if found:
            keys[_written_name(section.name)] = found
    sections = tuple(section for section in _kept_sections(file) if of_a_node or section.name.lower() != _CONNECTED)
    return KeptText(sections, keys)


def _written_name(name: str) -> str:
    """The name in lower case of the section that is written for *name*."""
    place = object_place(name)
    index, sub_index = place or (0, None)
    if place is None:
        return "devicecomissioning" if name.lower() == "devicecommissioning" else name.lower()
    return f"{index:04x}" if sub_index is None else f"{index:04x}sub{sub_index:x}"


def _kept_sections(file: EdsFile) -> Iterator[IniSection]:
    layout = file.layout
    for parts in (*layout.modules.values(), *layout.kept.values(), layout.device.get("comments", [])):
        yield from parts
    for index in layout.objects:
        yield from layout.object_sections(index).links


def not_held(file: EdsFile | XddFile, keeps: KeptText | None = None) -> list[str]:
    """Return the contents of *file* that its dictionary and *keeps* lack: each kind once, with count and first line."""
    found = list(_of_eds(file, keeps) if isinstance(file, EdsFile) else _of_xdd(file))
    return found + [f"line {finding.line}: {finding.text}" for finding in file.findings if finding.rule in _LEFT_OUT]


def _of_eds(file: EdsFile, keeps: KeptText | None) -> Iterator[str]:
    indices = {f"{index:04x}" for index in file.layout.objects}
    kept_sections = set(keeps.sections) if keeps else set()
    special = set(_kept_sections(file))
    stray = set(file.layout.stray)
    comments = _comment_lines(
        section for section in (file.text.preamble, *file.text.sections) if section not in kept_sections
    )
    if comments:
        yield f"{plural(len(comments), 'line')} of comment, the first in line {comments[0]}"
    for section in file.layout.stray:
        yield f"line {section.line}: section [{section.name[:60]}] is not understood"
    gone = [section for section in file.text.sections if section in special - kept_sections]
    names = [f"[{section.name[:60]}]" for section in gone if section.name.lower() != "comments"]
    if names:
        yield f"{plural(len(names), 'section')} {join_some(names)}"
    lines: dict[str, list[int]] = {}
    kept_keys = {key.lower() for keys in keeps.keys.values() for key in keys} if keeps else set()
    for section in file.text.sections:
        if section not in stray and section not in special:
            _other_keys(section, indices, kept_keys, lines)
    for name, at in lines.items():
        yield f"key {name[:60]}, {plural(len(at), 'time')}, the first in line {at[0]}"


def _comment_lines(sections: Iterable[IniSection]) -> list[int]:
    """Return the lines meant for human readers: `;` comments, and those of [Comments]."""
    found = []
    for section in sections:
        prose = section.name.lower() == "comments"
        for number, text in enumerate(section.text.split("\n")[1:], section.line + 1):
            said = text.strip()
            if said[:1] in (";", "#") or (prose and "=" in said and not said.lower().startswith("lines")):
                found.append(number)
    return found


def _other_keys(section: IniSection, indices: set[str], kept_keys: set[str], lines: dict[str, list[int]]) -> None:
    name = section.name.lower()
    if name in _ANEW or name == "comments":
        return
    table = name[4:] in ("name", "value", "denotation")
    sections = (OBJECT,) if name[:4] in indices else ("deviceinfo", "devicecomissioning")
    known = kept_keys | keys_that_are(Carried.HELD, *sections)
    for key, given in section_values([section], Findings()).items():
        if not table and key not in known and not key.startswith("baudrate_") and given.value:
            lines.setdefault(given.key, []).append(given.line)


def _of_xdd(file: XddFile) -> Iterator[str]:
    first: dict[str, int] = {}
    count: Counter[str] = Counter()
    for element in _every(file.tree.root):
        if element.name not in _ELEMENTS:
            first.setdefault(element.name, element.line)
            count[element.name] += 1
    for name, line in first.items():
        yield f"element {name[:60]}, {plural(count[name], 'time')}, the first in line {line}"


def _every(root: XmlElement) -> Iterator[XmlElement]:
    """Iterate over elements, except data types and all below an element that the dictionary lacks."""
    left = [root]
    while left:
        one = left.pop()
        if one.name == "characteristic" and characteristic(one)[0] in OWN_CHARACTERISTICS:
            continue
        yield one
        if one.name in _ELEMENTS and one.name != "parameter":
            left += reversed(one.children)
        elif one.name == "parameter":
            left += [child for child in reversed(one.children) if not child.name.isupper()]


#: Fields about the place in a file, excluded from the comparison.
_NOT_SAID = ("line", "entries", "index", "sub_index")
#: Fields of a scale, and their defaults.
_SCALE = {"factor": "1", "offset": "0"}


@dataclass(frozen=True, slots=True)
class DictionaryDifference:
    """A difference in an object (*place*, `6041:00`; empty: the device): attribute *what*, *before* and *after*.

    *what* is a name of `OdEntry`, `OdObject` or `DeviceInfo`, or `object` if only one side has the object.
    """

    place: str
    what: str
    before: Any
    after: Any


def differences(before: ObjectDictionary, after: ObjectDictionary) -> Iterator[DictionaryDifference]:
    """Everything that differs in *after* from *before* or is missing."""
    yield from _unlike("", _bare(before.info), _bare(after.info))
    yield from _unlike("", before.info.commissioning, after.info.commissioning)
    for index in sorted(before.keys() | after.keys()):
        held, left = before.get(index), after.get(index)
        if held is None or left is None:
            yield DictionaryDifference(f"{index:04X}", "object", held and held.name, left and left.name)
        else:
            yield from _in_object(held, left)


def _bare(info: DeviceInfo) -> DeviceInfo:
    """*info* without what is compared by itself, and modules: the file's text is kept."""
    return replace(info, commissioning=Commissioning(), modules=Modules())


def _in_object(held: OdObject, left: OdObject) -> Iterator[DictionaryDifference]:
    yield from _unlike(f"{held.index:04X}", held, left)
    for sub_index in sorted(held.entries.keys() | left.entries.keys()):
        one, other = held.entries.get(sub_index), left.entries.get(sub_index)
        name = f"{held.index:04X}:{sub_index:02X}"
        if one is None or other is None:
            yield DictionaryDifference(name, "object", one and one.name, other and other.name)
        else:
            yield from _unlike(name, one, other)


def _unlike(name: str, one: Any, other: Any) -> Iterator[DictionaryDifference]:
    for field in fields(one):
        before, after = getattr(one, field.name), getattr(other, field.name)
        if field.name not in _NOT_SAID and before != after and not _same_number(field.name, before, after):
            yield DictionaryDifference(name, field.name, before, after)


def _same_number(name: str, before: Any, after: Any) -> bool:
    """Whether two scale numbers are equal: `1/256` and `0.00390625`."""
    if name not in _SCALE:
        return False
    try:
        return parse_offset(before or _SCALE[name]) == parse_offset(after or _SCALE[name])
    except ValueError:
        return False


def without_values(dictionary: ObjectDictionary) -> ObjectDictionary:
    """The dictionary for every device of its type: without ParameterValue, denotation, node-ID and place."""
    objects = {index: _described_alone(dictionary[index]) for index in dictionary}
    info = replace(dictionary.info, node_id=None, commissioning=Commissioning())
    return ObjectDictionary(objects, info, dictionary.source)


def without_scalings(dictionary: ObjectDictionary) -> ObjectDictionary:
    """The dictionary without units and factors, for which CiA 306 has no keys."""
    objects = {
        index: replace(
            dictionary[index],
            entries={sub: replace(entry, unit="", factor="") for sub, entry in dictionary[index].entries.items()},
        )
        for index in dictionary
    }
    return ObjectDictionary(objects, dictionary.info, dictionary.source)


def _described_alone(one: OdObject) -> OdObject:
    return replace(one, entries={sub: _of_any_device(entry) for sub, entry in one.entries.items()})


def _of_any_device(entry: OdEntry) -> OdEntry:
    return replace(entry, value=None, value_relative=False, denotation="")
