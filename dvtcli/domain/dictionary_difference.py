"""Differences between two object dictionaries, whatever file they come from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

from dvtcli.domain.object_dictionary import Commissioning, DeviceInfo, Modules, ObjectDictionary, OdEntry, OdObject
from dvtcli.domain.scaling import parse_offset

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
