"""Search a node's dictionary by number, name and mappability. Asks no device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.object_scalings import value_text
from dvtcli.domain.rules.mapped_object import is_taken
from dvtcli.errors import UsageError
from dvtcli.operations.results import ObjectListing, ObjectRow

if TYPE_CHECKING:
    from dvtcli.domain.datatypes import Value
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.session.session import SessionNodes


def search_objects(
    session: SessionNodes, text: str | None = None, mappable: str | None = None, node_id: int | None = None
) -> ObjectListing:
    """List objects of a node (None: the selected node) with *text* in number or name, None for all.

    *mappable* is `tpdo` or `rpdo`: only objects for such a PDO. Raises UsageError if the node has no EDS.
    """
    node = session.node(node_id)
    dictionary = node.dictionary
    if dictionary is None:
        raise UsageError(
            f"node {node.node_id} has no EDS here: nothing names its objects",
            hint=Hint(Action.GIVE_EDS, why="names the EDS"),
        )
    entries = list(dictionary.entries())
    matching = (entry for entry in entries if _matches(dictionary, entry, text))
    found = ((entry, directions(dictionary, node.profile, entry)) for entry in matching)
    chosen = ((entry, ways) for entry, ways in found if mappable is None or mappable in ways)
    rows = tuple(  # what a file does not say, no row does
        object_row(dictionary, entry, node.node_id, ways if entry.pdo_mapping else ()) for entry, ways in chosen
    )
    return ObjectListing(node.node_id, dictionary.source, rows, len(entries))


def _matches(dictionary: ObjectDictionary, entry: OdEntry, text: str | None) -> bool:
    if text is None:
        return True
    name = normalised(dictionary.display_name(entry.index, entry.sub_index))
    return text.lower().removeprefix("0x") in entry.object.lower() or (
        bool(normalised(text)) and normalised(text) in name
    )


def directions(dictionary: ObjectDictionary, profile: DeviceProfile, entry: OdEntry) -> list[str]:
    """Return the kinds of PDO (`tpdo`, `rpdo`) that may map *entry*."""
    ways = (("tpdo", True), ("rpdo", False))
    return [way for way, tpdo in ways if is_taken(profile, dictionary, entry, tpdo=tpdo)]


def _shown(value: Value) -> str:
    """A default as it is typed."""
    return value_text(value) if isinstance(value, bytes | bool) else str(value)


def object_row(dictionary: ObjectDictionary, entry: OdEntry, node_id: int, ways: Sequence[str] = ()) -> ObjectRow:
    """Make an object's row with the *ways* to map it; the default is for node *node_id*."""
    kind = entry.data_type
    initial = entry.initial(node_id)
    default = ""
    if initial is not None and kind is not None:
        try:
            value = kind.decode(initial)
            default = f"0x{value:X}" if isinstance(value, int) and kind.short in ("u16", "u32") else _shown(value)
        except ValueError:
            default = initial.hex(" ")
    return ObjectRow(
        entry.object, dictionary.display_name(entry.index, entry.sub_index), kind.short if kind else "?",
        str(entry.access), " ".join(ways), default,
    )  # fmt: skip
