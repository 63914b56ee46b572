"""Completion of object names, for a shell and for the prompt alike; never opens a bus.

Knows dictionaries and what a PDO can still take. Does not know keys, menus or screens.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from dvtcli.cli.global_options import taken
from dvtcli.domain.mapping import DUMMY_BITS, MAX_PDO_BITS
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, normalised
from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.rules.mapped_object import FEEDS_TPDO, TAKES_RPDO
from dvtcli.errors import DvtcliError
from dvtcli.operations.options import Options
from dvtcli.operations.settings import Settings

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

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
    chosen = ctx.params.get("pdo")
    for dictionary, aliases in _dictionaries(ctx, session, getattr(chosen, "node_id", None)):
        room = _room(ctx, dictionary, aliases) if mapped else None
        items = _items(dictionary, aliases, room, incomplete)
        if items:
            return items[:MOST]
    return []


def _dictionaries(
    ctx: click.Context, session: Conversation, node_id: int | None
) -> list[tuple[ObjectDictionary, dict[str, str]]]:
    """What the session knows; in a shell, where none has begun, what the options typed so far name."""
    if session.started or session.is_open or session.base != Options():
        return session.completion_dictionaries(node_id)
    contexts = [ctx.find_root(), ctx]
    try:
        given = {name: value for one in contexts for name, value in taken(dict(one.params)).items()}
        from dvtcli.operations.device_files import offline_dictionaries

        return offline_dictionaries(_laid_over_files(given))
    except (DvtcliError, click.ClickException):
        return []  # a wrong option or file: it is said once the line is run


def _laid_over_files(given: dict[str, Any]) -> Options:
    """The options *given* and those of the settings files, as far as these can be used."""
    settings = Settings()
    settings.read_files()
    settings.typed = {name: (value, "option") for name, value in given.items()}
    found, _ = settings.resolved()
    return Options()._replace(**{name: value for name, (value, _) in found.items()})


def _items(
    dictionary: ObjectDictionary, aliases: Mapping[str, str], room: Room | None, incomplete: str
) -> list[CompletionItem]:
    named = dict(_alias_items(dictionary, aliases, room, incomplete))
    items = list(named.values())
    prefix = "0x" if incomplete.lower().startswith("0x") else ""
    for number, _, entry in _ranked(_rows(dictionary), incomplete):
        if number not in named and (room is None or room.takes(entry)):
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
        words = [
            (f"dummy/{bits}", f"skip {bits} bit{'' if bits == 1 else 's'}") for bits in sorted(set(DUMMY_BITS.values()))
        ]
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
    """The bits that *word* takes of the frame; 0 where nobody knows yet."""
    head, _, length = word.rpartition("/")
    if head and length.isdecimal():
        return int(length)
    try:
        numbers = parse_object(aliases.get(normalised(word), word))
    except ValueError:
        return 0
    found = dictionary.find(word)[:1] if numbers is None else [dictionary.entry(*numbers)]
    return next((entry.bits or 0 for entry in found if entry is not None), 0)


def _alias_items(
    dictionary: ObjectDictionary, aliases: Mapping[str, str], room: Room | None, incomplete: str
) -> Iterator[tuple[str, CompletionItem]]:
    """A profile's short names, where one is being typed, with the numbers they stand for."""
    for alias, target in aliases.items():
        if not incomplete or not alias.startswith(incomplete.lower()):
            continue
        numbers = parse_object(target)
        entry = dictionary.entry(*numbers) if numbers is not None else None
        if entry is not None and (room is None or room.takes(entry)):
            yield entry.object.lower(), CompletionItem(alias, help=_help(dictionary, entry, room))


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
    if not found and not by_number and len(name) >= SCATTERED:
        letters = re.compile("".join(f"[^{re.escape(char)}]*{re.escape(char)}" for char in name))
        yield from (row for row in rows if letters.match(row[1]))


def _matchers(wanted: str, name: str) -> Iterator[Callable[[Row], bool]]:
    yield lambda row: row[0].startswith(wanted)
    if ":" in wanted:  # 6C01:1 is 6C01:01
        yield lambda row: row[0].replace(":0", ":").startswith(wanted)
    if not name:
        return
    yield lambda row: row[1].startswith(name)
    yield lambda row: f"_{name}" in row[1] or f".{name}" in row[1]
    yield lambda row: name in row[1]


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
