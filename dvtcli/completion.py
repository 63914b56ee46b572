"""Completion of object names, for a shell and for the prompt alike; never opens a bus.

Knows dictionaries and what a PDO can still take. Does not know keys, menus or screens.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import click
from click.shell_completion import CompletionItem

from dvtcli.domain.mapping import DUMMY_BITS, MAX_PDO_BITS
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, normalised
from dvtcli.domain.object_syntax import MappedObject, resolve_entry
from dvtcli.domain.rules.mapping import FEEDS_TPDO, TAKES_RPDO

#: How many objects a menu shows at most.
MOST = 60
#: Letters in order but apart (`vav` for `velocity_actual_value`) are looked for from this length on.
SCATTERED = 3

#: An entry's number and name as they are compared with what is typed.
Row = tuple[str, str, OdEntry]


def object_items(ctx: click.Context, incomplete: str, *, mapped: bool) -> list[CompletionItem]:
    """Objects that *incomplete* may become; for a mapping only those that its PDO can still take."""
    session = ctx.find_root().obj
    if session is None:
        return []
    for dictionary, aliases in session.completion_dictionaries():
        room = _room(ctx, dictionary, aliases) if mapped else None
        items = _items(dictionary, aliases, room, incomplete)
        if items:
            return items[:MOST]
    return []


def _items(
    dictionary: ObjectDictionary, aliases: Mapping[str, str], room: Room | None, incomplete: str
) -> list[CompletionItem]:
    rows = _rows(dictionary)
    items = list(_alias_items(dictionary, aliases, room, incomplete))
    prefix = "0x" if incomplete.lower().startswith("0x") else ""
    for number, _, entry in _ranked(rows, incomplete):
        if room is None or room.takes(entry):
            items.append(CompletionItem(f"{prefix}{number.upper()}", help=_help(dictionary, entry, room)))
            if len(items) >= MOST:
                break
    if room is not None:
        items += room.dummies(incomplete)
    return items


@dataclass(frozen=True, slots=True)
class Room:
    """What a PDO being typed can still take: *left* bits of objects that *direction* allows.

    *says* tells whether the file has any PDOMapping; where it has, an object without one cannot be mapped.
    """

    direction: str
    left: int
    says: bool

    def takes(self, entry: OdEntry) -> bool:
        """Whether *entry* can be the next one."""
        allowed = FEEDS_TPDO if self.direction == "tpdo" else TAKES_RPDO
        mappable = entry.pdo_mapping or (entry.pdo_mapping is None and not self.says)
        return bool(mappable) and entry.access in allowed and (entry.bits or 1) <= self.left

    def share(self, entry: OdEntry) -> str:
        """How much of what is free *entry* takes: `4 of 6 free bytes`."""
        if entry.bits is None:
            return ""
        if entry.bits % 8 or self.left % 8:
            return f"{entry.bits} of {self.left} free bits"
        return f"{entry.bits // 8} of {self.left // 8} free bytes"

    def dummies(self, incomplete: str) -> list[CompletionItem]:
        """Gaps that an RPDO may skip."""
        if self.direction == "tpdo" or not incomplete or not "dummy/".startswith(incomplete.lower()[:6]):
            return []
        words = [(f"dummy/{bits}", f"skip {bits} bits") for bits in sorted(set(DUMMY_BITS.values()))]
        return [CompletionItem(word, help=text) for word, text in words if word.startswith(incomplete.lower())]


def _room(ctx: click.Context, dictionary: ObjectDictionary, aliases: Mapping[str, str]) -> Room | None:
    """What is left beside the objects that the line has already; None where no PDO was typed yet."""
    chosen = ctx.params.get("pdo")
    if chosen is None:
        return None
    typed = ctx.params.get("objects") or ()
    used = sum(_bits(word.text, dictionary, aliases) for word in typed)
    return Room(str(chosen.pdo.direction), max(0, MAX_PDO_BITS - used), _says(dictionary))


def _bits(word: str, dictionary: ObjectDictionary, aliases: Mapping[str, str]) -> int:
    try:
        found = resolve_entry(word, dictionary, dict(aliases))
    except ValueError:
        return 0
    if not isinstance(found, MappedObject) or found.bits is not None:
        return found.bits or 0
    entry = dictionary.entry(found.index, found.sub_index)
    return (entry.bits or 0) if entry is not None else 0


def _alias_items(
    dictionary: ObjectDictionary, aliases: Mapping[str, str], room: Room | None, incomplete: str
) -> Iterator[CompletionItem]:
    """A profile's short names, where one is being typed."""
    for alias, target in aliases.items():
        if not incomplete or not alias.startswith(incomplete.lower()):
            continue
        index, _, sub_index = target.removeprefix("0x").partition(":")
        try:
            entry = dictionary.entry(int(index, 16), int(sub_index or "0", 16))
        except ValueError:
            continue
        if entry is not None and (room is None or room.takes(entry)):
            yield CompletionItem(alias, help=f"{target}  {_help(dictionary, entry, room)}")


def _help(dictionary: ObjectDictionary, entry: OdEntry, room: Room | None) -> str:
    kind = entry.data_type.short if entry.data_type else "?"
    name = dictionary.display_name(entry.index, entry.sub_index)
    share = room.share(entry) if room is not None else ""
    return f"{name}  {kind} {entry.access}" + (f"  {share}" if share else "")


def _ranked(rows: list[Row], incomplete: str) -> Iterator[Row]:
    """*rows* that *incomplete* may mean, best first: by number, then by name, by a word of it, by a part of it.

    What begins with `0x` is a number and nothing else.
    """
    by_number = incomplete.lower().startswith("0x")
    wanted = incomplete.lower().removeprefix("0x")
    name = normalised(incomplete)
    found: set[int] = set()
    for matches in _matchers(wanted, "" if by_number else name):
        for number, row in enumerate(rows):
            if number not in found and matches(row):
                found.add(number)
                yield row


def _matchers(wanted: str, name: str) -> Iterator[Callable[[Row], bool]]:
    yield lambda row: row[0].startswith(wanted)
    if ":" in wanted:  # 6C01:1 is 6C01:01
        yield lambda row: row[0].replace(":0", ":").startswith(wanted)
    if not name:
        return
    yield lambda row: row[1].startswith(name)
    yield lambda row: f"_{name}" in row[1] or f".{name}" in row[1]
    yield lambda row: name in row[1]
    if len(name) >= SCATTERED:
        letters = re.compile(".*?".join(map(re.escape, name)))
        yield lambda row: letters.search(row[1]) is not None


#: The last dictionaries that were completed from, each with its rows: looking them through must not rebuild them.
_indexed: list[tuple[ObjectDictionary, list[Row], bool]] = []


def _rows(dictionary: ObjectDictionary) -> list[Row]:
    return _index(dictionary)[1]


def _says(dictionary: ObjectDictionary) -> bool:
    return _index(dictionary)[2]


def _index(dictionary: ObjectDictionary) -> tuple[ObjectDictionary, list[Row], bool]:
    for known in _indexed:
        if known[0] is dictionary:
            return known
    rows = [
        (entry.object.lower(), normalised(dictionary.display_name(entry.index, entry.sub_index)), entry)
        for entry in dictionary.entries()
    ]
    made = (dictionary, rows, any(entry.pdo_mapping is not None for _, _, entry in rows))
    _indexed[:] = [*_indexed[-7:], made]
    return made
