"""Objects to include from a device's file: whole objects, ranges, single sub-indices.

`Configuration` decides why an object is left out.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from dvtcli.domain.configuration import Configuration, NotWritten
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.object_dictionary import Access, OdEntry
from dvtcli.domain.pdo import BY_SUB_INDEX, Pdo
from dvtcli.domain.standard_objects import standard_entry
from dvtcli.errors import UsageError
from dvtcli.operations.values.named_objects import is_name, object_at

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import ObjectAddress, Range
    from dvtcli.operations.devices.held_device import HeldDevice

_COMMUNICATION, _STATES = range(0x1000, 0x2000), (0x1001, 0x1002)


class DifferenceKind(Enum):
    """The kind of a difference between two values."""

    SETTING = "it is configured otherwise"
    ABOUT = "it is another device, or another program"
    APART = "it commands, measures, or changes by itself"


def entry_of(dictionary: ObjectDictionary | None, place: ObjectAddress) -> OdEntry:
    """How the object at *place* is described: by *dictionary*, else by the standard, else not at all."""
    entry = None if dictionary is None else dictionary.entry(*place)
    if entry is not None:
        return entry
    standard = standard_entry(*place)
    if standard is None:
        return OdEntry(*place, "")
    return OdEntry(*place, "", standard.data_type, standard.access or Access.RW)


def is_setting(why: NotWritten | None) -> bool:
    """Tell whether an object not written for this reason (None: written) is still configured by somebody."""
    return why is None or why.may_be_setting or why in (NotWritten.FLAGGED, NotWritten.SAFETY)


def kind_of(known: Configuration, entry: OdEntry) -> DifferenceKind:
    """Classify a difference of the object *entry*; PDO parameters count, fixed or not."""
    if (pdo := Pdo.at(entry.index)) is not None:
        is_parameter = entry.index == pdo.mapping_index or entry.sub_index in BY_SUB_INDEX
        return DifferenceKind.SETTING if is_parameter else DifferenceKind.APART
    why = known.why_not(entry)
    if is_setting(why):
        return DifferenceKind.SETTING
    if why is not NotWritten.READ_ONLY or entry.index in _STATES:
        return DifferenceKind.APART
    return (
        DifferenceKind.ABOUT if entry.index in _COMMUNICATION or entry.access is Access.CONST else DifferenceKind.APART
    )


@dataclass(frozen=True, slots=True)
class Included:
    """A *word* of `include`: all sub-indices in *range*, or the single *object*."""

    word: str
    range: Range | None = None
    object: ObjectAddress | None = None

    @property
    def is_many(self) -> bool:
        """Tell whether it is a range of indices, whose objects are unknown."""
        return self.range is not None and self.range[0] != self.range[1]

    def of(self, held: HeldDevice) -> list[ObjectAddress]:
        """List its addresses with a value in *held*."""
        said = held.objects.keys() - held.assumed
        if self.range is None:
            return [place for place in said if place == self.object]
        return sorted(place for place in said if self.range[0] <= place[0] <= self.range[1])


def included_of(node: NodeDescription, held: HeldDevice, words: Collection[str]) -> tuple[Included, ...]:
    """Resolve *words* in *held*; raises UsageError for an unknown object, or if the file has no value."""
    found = tuple(_included(node, word) for word in words)
    for included in found:
        if not included.is_many and not included.of(held):
            raise UsageError(
                f"names nothing of {held.name}: the file has no value of it",
                given={"include": included.word},
                node=node.node_id,
                hint=Hint(
                    Action.PLAN,
                    {"file": held.name},
                    "lists what the file says and is not written; INDEX, INDEX:SUB, or 2000-2FFF",
                ),
            )
    return found


def idle(held: HeldDevice, known: Configuration, included: Collection[Included]) -> Iterator[Hint]:
    """Report entries of *included* without effect: objects written anyway, or never."""
    for inclusion in included:
        places = inclusion.of(held)
        if not places:
            yield Hint(Action.GIVE, {"include": inclusion.word}, f"names nothing of {verbatim(held.name)}")
        elif not inclusion.is_many and (text := _why_idle(known, places)):
            yield Hint(Action.GIVE, {"include": inclusion.word}, f"{{}}: {verbatim(text)}")


def _why_idle(known: Configuration, places: Collection[ObjectAddress]) -> str:
    """Explain why including *places* has no effect; empty if it has."""
    if all(Pdo.at(index) is not None for index, _ in places):
        return "a PDO's, which is written without it"
    dictionary = known.dictionary
    own = known.without_included()
    whys = [own.why_not_unread(entry_of(dictionary, place)) for place in places] if dictionary else []
    if not whys or any(why is not None and why.is_lifted_by_include for why in whys):
        return ""
    never = next((why for why in whys if why not in (None, NotWritten.READ_ONLY)), None)
    if never is None and None in whys:
        return "it is written without it"
    return f"it is not written nevertheless: it {never or NotWritten.READ_ONLY}"


def _included(node: NodeDescription, word: str) -> Included:
    first, dash, last = word.partition("-")
    if dash:
        try:
            low, high = int(first, 16), int(last, 16)
        except ValueError:
            low, high = 1, 0
        if not 0x1000 <= low <= high <= 0xFFFF:
            raise UsageError("a range of indices is written 2000-2FFF", given={"include": word})
        return Included(word, (low, high))
    index, sub_index = object_at(node, word)
    if ":" in word or (is_name(word) and sub_index):
        return Included(word, object=(index, sub_index))
    return Included(word, (index, index))
