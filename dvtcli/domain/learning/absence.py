"""Objects listed in a file but missing in the device, and their meaning for a simulated family.

Only communication parameters and mapped objects are checked, as a file may be long. Pure; reads nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

from dvtcli.domain.abort import abort_text
from dvtcli.domain.learning.learnt_value import Learnt
from dvtcli.domain.learning.probe import ProbedPdo
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry

#: Checked communication parameters: up to the PDOs' mappings.
_LOOKED_AT = range(0x1000, 0x1C00)


@dataclass(frozen=True, slots=True)
class Absence:
    """A missing object, sub-index 0 for a whole object, and its abort *code*."""

    index: int
    sub_index: int
    code: int

    @property
    def place(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.sub_index

    @property
    def name(self) -> str:
        """`1804` for a whole object, `1803:05` for a sub-index."""
        return f"{self.index:04X}:{self.sub_index:02X}" if self.sub_index else f"{self.index:04X}"


def listed(dictionary: ObjectDictionary, subjects: Iterable[ProbedPdo]) -> dict[int, list[int]]:
    """Sub-indices to check, by index: readable entries of fixed length, cheap to read."""
    mapped = {
        (entry.index, entry.sub_index) for subject in subjects for entry in (*subject.objects, *subject.unmappable)
    }
    places = {(entry.index, entry.sub_index) for index in dictionary if index in _LOOKED_AT for entry in
              dictionary[index].entries.values() if _short(entry)}  # fmt: skip
    places |= {place for place in mapped if (entry := dictionary.entry(*place)) is not None and _short(entry)}
    found: dict[int, list[int]] = {}
    for index, sub_index in sorted(places):
        found.setdefault(index, []).append(sub_index)
    return found


def _short(entry: OdEntry) -> bool:
    return entry.access.readable and entry.data_type is not None and entry.data_type.size is not None


def absent_for_family(absences: Collection[Absence]) -> Iterator[Learnt]:
    """Objects that a simulated device must lack too, with the same abort codes."""
    for absence in absences:
        place = f"0x{absence.name}"
        evidence = f"{place} is in the file, and reading it answered 0x{absence.code:08X} ({abort_text(absence.code)})"
        yield Learnt(f"absent.{absence.name}", absence.code, evidence)
