"""The objects that may be mapped into a PDO, filtered as one types: those that fit first. Pure."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.rules.mapped_object import is_taken

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.object_scalings import ObjectScalings
    from dvtcli.domain.profile import DeviceProfile


#: a sub-index of one digit
_SHORT_SUB = re.compile(r"^([0-9a-f]{4}):([0-9a-f])$")


@dataclass(frozen=True, slots=True)
class MappableRow:
    """An object with its name and its unit; *search* is what the filter looks at, *taken* by direction of a PDO."""

    entry: OdEntry
    name: str
    unit: str
    search: str
    taken: tuple[bool, bool]


@dataclass(frozen=True, slots=True)
class Offer:
    """An object in the list, and why it cannot be mapped; empty if it can."""

    listed: MappableRow
    reason: str = ""


class ObjectList:
    """All objects of *dictionary*, looked at once."""

    def __init__(self, dictionary: ObjectDictionary | None, profile: DeviceProfile, scalings: ObjectScalings) -> None:
        self._listed: list[MappableRow] = []
        if dictionary is not None:
            self._listed = [_listed(dictionary, profile, scalings, entry) for entry in dictionary.entries()]
        #: each object, its offer if it can be mapped, and if it cannot, into an RPDO and into a TPDO
        self._offers = [(listed, Offer(listed), (_refused(listed, 0), _refused(listed, 1))) for listed in self._listed]
        self._last: tuple[tuple[str, bool, int], list[Offer]] | None = None

    def offers(self, text: str, *, tpdo: bool, bits_left: int) -> list[Offer]:
        """Return the objects with *text* in number, name or unit: those that fit first, then the others."""
        asked = text, tpdo, bits_left
        if self._last is None or self._last[0] != asked:
            self._last = asked, self._found(*asked)
        return self._last[1]

    def _found(self, text: str, tpdo: bool, bits_left: int) -> list[Offer]:
        wanted = normalised(_SHORT_SUB.sub(r"\1:0\2", text.lower().removeprefix("0x")))
        word = f" {wanted}"
        numbers, names, others, too_long, refused = [list[Offer]() for _ in range(5)]
        for listed, offer, refusals in self._offers:
            search = listed.search
            if wanted and wanted not in search:
                continue
            if not listed.taken[tpdo]:
                refused.append(refusals[tpdo])
            elif (listed.entry.bits or 1) > bits_left:
                too_long.append(Offer(listed, f"{listed.entry.bits} bits, {bits_left} are free"))
            elif search.startswith(wanted):
                numbers.append(offer)
            else:
                (names if word in search else others).append(offer)
        return [*numbers, *names, *others, *too_long, *refused]


def _listed(
    dictionary: ObjectDictionary, profile: DeviceProfile, scalings: ObjectScalings, entry: OdEntry
) -> MappableRow:
    name = dictionary.display_name(entry.index, entry.sub_index)
    unit = scalings.of(entry.index, entry.sub_index).unit
    search = f"{normalised(entry.object)} {normalised(name)} {unit.lower()}"
    rpdo, tpdo = (is_taken(profile, dictionary, entry, tpdo=way) for way in (False, True))
    return MappableRow(entry, name, unit, search, (rpdo, tpdo))


def _refused(listed: MappableRow, tpdo: int) -> Offer:
    other = "RPDO only" if tpdo else "TPDO only"
    return Offer(listed, other if listed.taken[not tpdo] else "not mappable")
