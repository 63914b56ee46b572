"""A file's text as lint rules see it: sections with their values, each read once.

Findings of the reader are in `EdsFile.findings`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.text import join_some
from dvtcli.files.eds.findings import EdsFinding, Findings
from dvtcli.files.eds.ini import IniSection, IniValue, Values, section_values
from dvtcli.files.eds.reader import EdsFile
from dvtcli.files.eds.sections import object_place


def no_section(text: LintedText, name: str, lost: str) -> Found:
    """Find a file without the section *name*; *lost* is the missing information."""
    if text.section(name.lower()) is None:
        yield 1, f"there is no [{name}]: {lost}"


def missing_keys(text: LintedText, name: str, needed: Iterable[str]) -> Found:
    """Find missing keys (of *needed*) in the section *name*, all in one finding."""
    section, values = text.section(name.lower()), text.values(name.lower())
    missing = [key for key in needed if key.lower() not in values]
    if section is not None and missing:
        yield section.line, f"[{name}] lacks {join_some(missing)}"


def named(finding: EdsFinding, shown: str, dictionary: ObjectDictionary) -> EdsFinding:
    """*finding* with the object *shown* (`6C01:01`, or `6C01` as a whole), and its data type, in the text."""
    if not shown:
        return finding
    index, _, sub_index = shown.partition(":")
    held = dictionary.get(int(index, 16))
    if not sub_index and held is not None and list(held.entries) == [0]:
        shown, sub_index = f"{index}:00", "00"
    entry = None if held is None or not sub_index else held.entries.get(int(sub_index, 16))
    kind = "" if entry is None or entry.data_type is None else f" {entry.data_type.name}"
    return finding._replace(object=shown, text=f"{shown}{kind}: {finding.text}")


#: Results of a rule: line (from 1) and text.
Found = Iterator[tuple[int, str]]


@dataclass(frozen=True, slots=True)
class ObjectText:
    """A section of an object (*sub_index* None) or a sub-index, with *values* by key in lower case."""

    index: int
    sub_index: int | None
    section: IniSection
    values: Values


@dataclass(frozen=True)
class LintedText:
    """A parsed *file* and its *name* without folder."""

    file: EdsFile
    name: str

    @property
    def is_dcf(self) -> bool:
        """Whether the name ends in .dcf."""
        return self.name.lower().endswith(".dcf")

    @property
    def is_eds(self) -> bool:
        """Whether the name ends in .eds."""
        return self.name.lower().endswith(".eds")

    def section(self, name: str) -> IniSection | None:
        """Return the (first) device section *name* (in lower case); None if absent."""
        return next(iter(self.file.layout.device.get(name, ())), None)

    def values(self, name: str) -> Values:
        """Return the device section *name* (in lower case) by key in lower case; empty if absent."""
        return section_values(self.file.layout.device.get(name, ()), Findings())

    @cached_property
    def objects(self) -> tuple[ObjectText, ...]:
        """All sections of objects in the file's order, without tables."""
        return tuple(self._objects())

    def _objects(self) -> Iterator[ObjectText]:
        for section in self.file.text.sections:
            place = object_place(section.name)
            if place is not None and place[0] in self.file.layout.objects and not _is_table(section):
                yield ObjectText(*place, section, section_values([section], Findings()))

    @cached_property
    def of_many(self) -> frozenset[int]:
        """The objects with sections of sub-indices."""
        return frozenset(text.index for text in self.objects if text.sub_index is not None)


def is_head(text: LintedText, one: ObjectText) -> bool:
    """Whether *one* is an object with sections of sub-indices, so that keys of entries have no effect."""
    return one.sub_index is None and one.index in text.of_many and "compactsubobj" not in one.values


def given(values: Values, key: str) -> IniValue | None:
    """Return the value of *key* (in lower case), None if absent or empty."""
    found = values.get(key)
    return found if found is not None and found.value else None


def all_given(values: Values, keys: Iterable[str]) -> Iterator[IniValue]:
    """Iterate over the non-empty values of *keys* (in lower case)."""
    return (value for key in keys if (value := given(values, key)) is not None)


def _is_table(section: IniSection) -> bool:
    return section.name[4:].lower() in ("name", "value", "denotation", "objectlinks")
