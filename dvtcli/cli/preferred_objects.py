"""Objects that a menu offers first: those of the user's recent lines, then those that devices of the kind map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.object_syntax import parse_object

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import DeviceProfile, ObjectAddress

#: number of recent lines that count, and the length of a line that may
_RECENT, _LONGEST = 100, 400
#: what drives (CiA 402) and I/O modules (CiA 401) map first, in this order
_USUAL: tuple[ObjectAddress, ...] = (
    (0x6041, 0), (0x6040, 0), (0x606C, 0), (0x6064, 0), (0x60FF, 0), (0x607A, 0), (0x6077, 0), (0x6061, 0),
    (0x6060, 0), (0x6000, 1), (0x6200, 1), (0x6401, 1), (0x6411, 1),
)  # fmt: skip


def preferred_objects(
    session: Conversation, dictionary: ObjectDictionary, profile: DeviceProfile
) -> Mapping[ObjectAddress, int]:
    """Return objects with their places in the menu, from 0; the user's own by how often recent lines have them."""
    counts: dict[ObjectAddress, int] = {}
    for line in session.recent_lines()[-_RECENT:]:
        for address in _named(line[:_LONGEST], profile.aliases):
            counts[address] = counts.get(address, 0) + 1
    own = sorted(counts, key=lambda address: -counts[address])
    usual = (*_USUAL, *filter(None, map(parse_object, profile.aliases.values())))
    known = (address for address in (*own, *usual) if dictionary.entry(*address) is not None)
    return {address: place for place, address in enumerate(dict.fromkeys(known))}


def _named(line: str, aliases: Mapping[str, str]) -> Iterator[ObjectAddress]:
    """Iterate over the objects of a *line*, by number or by the profile's names."""
    for word in line.replace(",", " ").split()[1:]:
        text = word.partition("/")[0]
        try:
            address = parse_object(aliases.get(normalised(text), text))
        except ValueError:  # another kind of number
            continue
        if address is not None:
            yield address
