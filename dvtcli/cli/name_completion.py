"""Complete object names in a shell and at the prompt; names from files are made safe for the shell."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem, ShellComplete, add_completion_class, get_completion_class

from dvtcli.cli.global_options import taken
from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, normalised
from dvtcli.domain.object_syntax import USUAL, parse_object
from dvtcli.domain.pdo import DUMMY_BITS, MAX_PDO_BITS
from dvtcli.domain.profile import DeviceProfile, ObjectAddress
from dvtcli.domain.rules.mapped_object import is_taken
from dvtcli.domain.rules.pdo_mapping import known_dummies
from dvtcli.domain.text import safe
from dvtcli.errors import DvtcliError
from dvtcli.operations.user.options import Options
from dvtcli.operations.user.settings import Settings

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: How many objects a menu shows at most.
MOST = 60
#: Letters in order but apart (`vav` for `velocity_actual_value`) are looked for from this length on.
SCATTERED = 3
#: An entry's number and name in the form for comparison with the typed text.
Row = tuple[str, str, OdEntry]


def object_items(ctx: click.Context, incomplete: str, *, mapped: bool) -> list[CompletionItem]:
    """Return the objects that *incomplete* may become; if *mapped*, those that still fit the PDO."""
    session = ctx.find_root().obj
    if session is None:
        return []
    chosen = ctx.params.get("pdo")
    for dictionary, profile in _dictionaries(ctx, session, getattr(chosen, "node_id", None)):
        room = _room(ctx, dictionary, profile) if mapped else None
        items = _items(dictionary, profile.aliases, room, incomplete, preferred_objects(session, dictionary, profile))
        if items:
            return items[:MOST]
    return []


def _dictionaries(
    ctx: click.Context, session: Conversation, node_id: int | None
) -> list[tuple[ObjectDictionary, DeviceProfile]]:
    """Return the session's dictionaries; in a shell, those of the options typed so far."""
    if session.started or session.is_open or session.base != Options():
        return session.completion_dictionaries(node_id)
    contexts = [ctx.find_root(), ctx]
    try:
        given = {name: value for context in contexts for name, value in taken(dict(context.params)).items()}
        from dvtcli.operations.session.device_files import offline_dictionaries

        return offline_dictionaries(_laid_over_files(given))
    except (DvtcliError, click.ClickException):
        return []  # a wrong option or file: it is said once the line is run


def _laid_over_files(given: dict[str, Any]) -> Options:
    """Merge the options *given* over usable options of the settings files."""
    settings = Settings()
    settings.read_files()
    settings.typed = {name: (value, name) for name, value in given.items()}
    found, _ = settings.resolved()
    return Options()._replace(**{name: value for name, (value, _) in found.items()})


def _items(
    dictionary: ObjectDictionary,
    aliases: Mapping[str, str],
    room: Room | None,
    incomplete: str,
    preferred: Mapping[ObjectAddress, int],
) -> list[CompletionItem]:
    named = dict(_alias_items(dictionary, aliases, room, incomplete))
    items = list(named.values())
    if room is not None:
        items += room.dummies(incomplete)
    prefix = "0x" if incomplete.lower().startswith("0x") else ""
    for number, _, entry in _ranked(_rows(dictionary), incomplete, preferred):
        if number not in named and (room is None or room.takes(entry)):
            items.append(CompletionItem(f"{prefix}{number.upper()}", help=_help(dictionary, entry, room)))
            if len(items) >= MOST:
                break
    return items


@dataclass(frozen=True, slots=True)
class Room:
    """The free space of a PDO being typed: *left* bits for objects of `map`, on a device of *profile*.

    *mapped* are objects already on the line: an RPDO may map each once.
    """

    dictionary: ObjectDictionary
    profile: DeviceProfile
    tpdo: bool
    left: int
    mapped: frozenset[ObjectAddress] = frozenset()

    def takes(self, entry: OdEntry) -> bool:
        """Whether *entry* can be mapped next."""
        again = not self.tpdo and (entry.index, entry.sub_index) in self.mapped
        fits = (entry.bits or 1) <= self.left
        return fits and not again and is_taken(self.profile, self.dictionary, entry, tpdo=self.tpdo)

    def share(self, entry: OdEntry) -> str:
        """Return the share of free space for *entry*: `4 of 6 free bytes`."""
        if entry.bits is None:
            return ""
        if entry.bits % 8 or self.left % 8:
            return f"{entry.bits} of {self.left} free bits"
        return f"{entry.bits // 8} of {self.left // 8} free bytes"

    def dummies(self, incomplete: str) -> list[CompletionItem]:
        """Return dummies for gaps in an RPDO."""
        if self.tpdo or not incomplete or not "dummy/".startswith(incomplete.lower()[:6]):
            return []
        usable = known_dummies(self.dictionary, self.profile)
        lengths = {
            bits for index, bits in DUMMY_BITS.items() if bits <= self.left and (usable is None or index in usable)
        }
        words = [
            (f"dummy/{bits}", f"skip {bits} bit{'' if bits == 1 else 's'}")
            for bits in sorted(lengths, key=lambda bits: (bits % 8 != 0, bits))
        ]
        return [CompletionItem(word, help=text) for word, text in words if word.startswith(incomplete.lower())]


def _room(ctx: click.Context, dictionary: ObjectDictionary, profile: DeviceProfile) -> Room | None:
    """Return the free space after the objects on the line; None before a PDO is typed."""
    chosen = ctx.params.get("pdo")
    if chosen is None:
        return None
    typed = [_typed(word.text, dictionary, profile.aliases) for word in ctx.params.get("objects") or ()]
    left = max(0, MAX_PDO_BITS - sum(bits for _, bits in typed))
    places = frozenset(place for place, _ in typed if place is not None)
    return Room(dictionary, profile, chosen.pdo.is_tpdo, left, places)


def _typed(word: str, dictionary: ObjectDictionary, aliases: Mapping[str, str]) -> tuple[ObjectAddress | None, int]:
    """Return the object of *word*, and its bits in the frame; None and 0 if unknown."""
    head, _, length = word.rpartition("/")
    given = int(length) if head and length.isdecimal() and int(length) else None
    name = word if given is None else head
    try:
        numbers = parse_object(aliases.get(normalised(name), name))
    except ValueError:
        return None, given or 0
    found = dictionary.find(name)[:1] if numbers is None else [dictionary.entry(*numbers)]
    entry = next((candidate for candidate in found if candidate is not None), None)
    if entry is None:
        return None, given or 0
    return (entry.index, entry.sub_index), entry.bits or 0 if given is None else given


def _alias_items(
    dictionary: ObjectDictionary, aliases: Mapping[str, str], room: Room | None, incomplete: str
) -> Iterator[tuple[str, CompletionItem]]:
    """Return matching short names of a profile, with their objects."""
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


def _ranked(rows: list[Row], incomplete: str, preferred: Mapping[ObjectAddress, int]) -> Iterator[Row]:
    """Return *rows* matching *incomplete*, best first: beginnings of numbers and names, *preferred* objects, parts.

    A text with `0x` matches numbers only.
    """
    by_number = incomplete.lower().startswith("0x")
    wanted = incomplete.lower().removeprefix("0x")
    name = normalised(incomplete)
    found: set[int] = set()

    def matching(matches: Callable[[Row], bool]) -> list[Row]:
        new = [number for number, row in enumerate(rows) if number not in found and matches(row)]
        found.update(new)
        return sorted((rows[number] for number in new), key=lambda row: _preference(row, preferred))

    beginnings, parts = _matchers(wanted, "" if by_number else name)
    for matches in beginnings:
        yield from matching(matches)
    others = [row for matches in parts for row in matching(matches)]
    yield from sorted(others, key=lambda row: _preference(row, preferred))
    if not found and not by_number and len(name) >= SCATTERED:
        letters = re.compile("".join(f"[^{re.escape(char)}]*{re.escape(char)}" for char in name))
        yield from (row for row in rows if letters.match(row[1]))


def _preference(row: Row, preferred: Mapping[ObjectAddress, int]) -> int:
    """Return the place of an entry among the *preferred*, behind all of them for others."""
    return preferred.get((row[2].index, row[2].sub_index), len(preferred))


def _matchers(wanted: str, name: str) -> tuple[list[Callable[[Row], bool]], list[Callable[[Row], bool]]]:
    """Return what matches beginnings, and what matches parts, of a number *wanted* or a *name*."""
    beginnings: list[Callable[[Row], bool]] = [lambda row: row[0].startswith(wanted)]
    if ":" in wanted:  # 6C01:1 is 6C01:01
        beginnings.append(lambda row: row[0].replace(":0", ":").startswith(wanted))
    if not name:
        return beginnings, []
    letters = name.replace("_", "")
    beginnings += [
        lambda row: row[1] == name,
        lambda row: row[1].startswith(name),
        lambda row: row[1].replace("_", "").startswith(letters),  # `statusw` is the beginning of `status_word`
    ]
    return beginnings, [lambda row: f"_{name}" in row[1] or f".{name}" in row[1], lambda row: name in row[1]]


#: The last dictionaries that were completed from, each with its rows: looking them through must not rebuild them.
_indexed: list[tuple[ObjectDictionary, list[Row]]] = []


def _rows(dictionary: ObjectDictionary) -> list[Row]:
    for known, rows in _indexed:
        if known is dictionary:
            return rows
    rows = [
        (entry.object.lower(), normalised(dictionary.display_name(entry.index, entry.sub_index)), entry)
        for entry in dictionary.entries()
    ]
    _indexed[:] = [*_indexed[-7:], (dictionary, rows)]
    return rows


_SHELLS = ("bash", "zsh", "fish", "powershell")


def safe_items(items: Iterable[CompletionItem]) -> list[CompletionItem]:
    """Return *items* with safe help texts, without items that would type control characters."""
    return [
        CompletionItem(item.value, item.type, None if item.help is None else safe(item.help))
        for item in items
        if safe(item.value) == item.value
    ]


class _SafeComplete(ShellComplete):
    def get_completions(self, args: list[str], incomplete: str) -> list[CompletionItem]:
        """Return click's completions, made safe."""
        return safe_items(super().get_completions(args, incomplete))


def make_shells_safe() -> None:
    """Let click give safe completions to every shell."""
    for name in _SHELLS:
        usual = get_completion_class(name)
        if usual is None:  # PowerShell came with click 8.5
            continue

        class Safe(_SafeComplete, usual):  # type: ignore[misc, valid-type]
            pass

        add_completion_class(Safe, name)


#: number of recent lines that count, and the length of a line that may
_RECENT, _LONGEST = 100, 400


def preferred_objects(
    session: Conversation, dictionary: ObjectDictionary, profile: DeviceProfile
) -> Mapping[ObjectAddress, int]:
    """Return objects with their places in the menu, from 0; the user's own by how often recent lines have them."""
    counts: dict[ObjectAddress, int] = {}
    for line in session.recent_lines()[-_RECENT:]:
        for address in _named(line[:_LONGEST], profile.aliases):
            counts[address] = counts.get(address, 0) + 1
    own = sorted(counts, key=lambda address: -counts[address])
    usual = (*USUAL, *filter(None, map(parse_object, profile.aliases.values())))
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
