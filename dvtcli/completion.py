"""Completion of object names, for a shell and for the prompt alike; never opens a bus."""

from __future__ import annotations

from collections.abc import Iterator

import click
from click.shell_completion import CompletionItem

from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry, normalised
from dvtcli.domain.rules.mapping import FEEDS_TPDO, TAKES_RPDO

#: How many objects a menu shows at most.
MOST = 60


def object_items(ctx: click.Context, incomplete: str, *, mapped: bool) -> list[CompletionItem]:
    """Objects that *incomplete* may become; for a mapping only those that its PDO can take."""
    session = ctx.find_root().obj
    if session is None:
        return []
    direction = _direction(ctx) if mapped else None
    items: list[CompletionItem] = []
    for dictionary, aliases in session.completion_dictionaries():
        for entry in _ranked(dictionary, incomplete):
            if direction is None or _fits(entry, direction):
                items.append(_item(dictionary, entry, incomplete))
            if len(items) >= MOST:
                return items
        items += [CompletionItem(a, help=o) for a, o in aliases.items() if incomplete and a.startswith(incomplete)]
    return items


def _direction(ctx: click.Context) -> str | None:
    chosen = ctx.params.get("pdo")
    return None if chosen is None else str(chosen.pdo.direction)


def _fits(entry: OdEntry, direction: str) -> bool:
    allowed = FEEDS_TPDO if direction == "tpdo" else TAKES_RPDO
    return entry.access in allowed and entry.pdo_mapping is not False and (entry.bits or 64) <= 64


def _ranked(dictionary: ObjectDictionary, incomplete: str) -> Iterator[OdEntry]:
    """Entries whose number or name begins with *incomplete*, then those with a word that does."""
    wanted = incomplete.lower().removeprefix("0x")
    by_number = incomplete.lower().startswith("0x")
    name = normalised(incomplete)
    later: list[OdEntry] = []
    for entry in dictionary.entries():
        if entry.object.lower().startswith(wanted):
            yield entry
        elif not by_number and name:
            own = normalised(dictionary.display_name(entry.index, entry.sub_index))
            if own.startswith(name):
                yield entry
            elif f"_{name}" in own or f".{name}" in own:
                later.append(entry)
    yield from later


def _item(dictionary: ObjectDictionary, entry: OdEntry, incomplete: str) -> CompletionItem:
    prefix = "0x" if incomplete.lower().startswith("0x") else ""
    kind = entry.data_type.short if entry.data_type else "?"
    name = dictionary.display_name(entry.index, entry.sub_index)
    return CompletionItem(f"{prefix}{entry.object}", help=f"{name}  {kind} {entry.access}")
