"""Objects of a node's dictionary, searched by number, name and what a PDO can take. Asks no device."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.rules.mapped_object import FEEDS_TPDO, TAKES_RPDO
from dvtcli.errors import UsageError
from dvtcli.operations.results import ObjectListing, ObjectRow

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.operations.session import Session


def search_objects(session: Session, text: str | None = None, mappable: str | None = None) -> ObjectListing:
    """List the selected node's objects whose number or name contains *text*, None for all.

    *mappable* is `tpdo` or `rpdo`: only what such a PDO can take. UsageError where the node has no EDS here.
    """
    node = session.node()
    dictionary = node.dictionary
    if dictionary is None:
        raise UsageError(f"node {node.node_id} has no EDS here: nothing names its objects", hint="--eds FILE gives one")
    entries = list(dictionary.entries())
    chosen = [entry for entry in entries if _matches(dictionary, entry, text) and _fits(dictionary, entry, mappable)]
    rows = tuple(object_row(dictionary, entry, node.node_id) for entry in chosen)
    return ObjectListing(node.node_id, dictionary.source, rows, len(entries))


def _matches(dictionary: ObjectDictionary, entry: OdEntry, text: str | None) -> bool:
    if text is None:
        return True
    name = normalised(dictionary.display_name(entry.index, entry.sub_index))
    return text.lower().removeprefix("0x") in entry.object.lower() or (
        bool(normalised(text)) and normalised(text) in name
    )


def _fits(dictionary: ObjectDictionary, entry: OdEntry, mappable: str | None) -> bool:
    """Where the file says of no object whether it can be mapped, access alone decides."""
    if mappable is None:
        return True
    unknown = entry.pdo_mapping is None and not dictionary.tells_mappability
    return mappable in (_accepting(entry) if unknown else _directions(entry).split())


def _directions(entry: OdEntry) -> str:
    return " ".join(_accepting(entry)) if entry.pdo_mapping else ""


def _accepting(entry: OdEntry) -> list[str]:
    """The ways that the entry's access type allows."""
    ways = (("tpdo", FEEDS_TPDO), ("rpdo", TAKES_RPDO))
    return [way for way, accesses in ways if entry.access in accesses]


def object_row(dictionary: ObjectDictionary, entry: OdEntry, node_id: int) -> ObjectRow:
    """One object as a row; its default value as on node *node_id*."""
    kind = entry.data_type
    initial = entry.initial(node_id)
    default = ""
    if initial is not None and kind is not None:
        try:
            value = kind.decode(initial)
            default = f"0x{value:X}" if isinstance(value, int) and kind.short in ("u16", "u32") else str(value)
        except ValueError:
            default = initial.hex(" ")
    return ObjectRow(
        entry.object, dictionary.display_name(entry.index, entry.sub_index), kind.short if kind else "?",
        str(entry.access), _directions(entry), default,
    )  # fmt: skip
