"""Objects and mapping entries as people write them, found in a node's dictionary. Asks no device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_syntax import (
    MappedObject,
    Skipped,
    UnknownName,
    has_sub_index,
    resolve_entry,
    resolve_object,
)
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.pdo import Direction

T = TypeVar("T")


def object_at(node: NodeDescription, text: str) -> tuple[int, int]:
    """Parse `0x6C01:1`, `6041`, `statusword`… into index and sub-index; raises UsageError for unknown names."""
    return _resolved(resolve_object, text, node)


def object_index(node: NodeDescription, text: str) -> int:
    """Return the index of the object *text* for a pin; raises UsageError if it is none, or a sub-index."""
    index, sub_index = object_at(node, text)
    if sub_index:
        raise UsageError(f"a pin is linked to an object: {index:04X}, without a sub-index", node=node.node_id)
    return index


def tied_name(node: NodeDescription, index: int) -> str:
    """Name an object by the EDS, else by the profile."""
    if node.dictionary is not None and index in node.dictionary:
        return node.dictionary[index].name
    return next((alias for alias, place in node.profile.aliases.items() if place == f"{index:04X}:00"), "")


def means_whole(node: NodeDescription, text: str) -> bool:
    """Tell whether *text* names a record or array without a sub-index: `1018`, not `1018:0`.

    By the node's EDS, else by CiA 301; False for other objects. Raises UsageError if *text* is not an object.
    """
    if is_name(text) or has_sub_index(text):
        return False
    index, _ = object_at(node, text)
    if node.dictionary is not None and index in node.dictionary:
        return len(node.dictionary[index].entries) > 1
    from dvtcli.domain.object_dictionary import ObjectType
    from dvtcli.domain.standard_objects import standard_object_type

    return standard_object_type(index) in (ObjectType.ARRAY, ObjectType.RECORD)


def refuse_whole(node: NodeDescription, text: str) -> None:
    """Raises UsageError if *text* is a whole record: a file takes a single value."""
    if means_whole(node, text):
        raise UsageError(
            f"{text} has several sub-indices, but a file is for one",
            node=node.node_id,
            hint=Hint(Action.READ, {"object": f"{text}:1", "into": "FILE"}, "for example: {}"),
        )


def entry_at(node: NodeDescription, text: str, direction: Direction | None = None) -> MappedObject | Skipped:
    """Parse a mapping entry of a PDO of *direction* into object and length, or skipped bits.

    Raises UsageError for an unknown name.
    """
    return _resolved(resolve_entry, text, node, direction)


def is_name(text: str) -> bool:
    """Tell whether *text* is a name, which needs a dictionary."""
    try:
        resolve_entry(text, None, {})
    except UnknownName:
        return True
    except ValueError:
        return False
    return False


def name_hint(unknown: UnknownName) -> Hint | str:
    """Suggest a remedy for an unknown name."""
    if unknown.similar:
        return f"did you mean {', '.join(unknown.similar)}?"
    return Hint(Action.FIND_OBJECTS, why="searches the dictionary") + Hint(Action.GIVE_EDS, why="names the EDS")


def one_name(words: Sequence[str], is_object: Callable[[str], bool]) -> str | None:
    """Suggest quotes if neighbouring *words* together name an object."""
    for length in range(len(words), 1, -1):
        for first in range(len(words) - length + 1):
            name = " ".join(words[first : first + length])
            if is_object(name):
                return f'{name!r} is one name; write {name.replace(" ", "_")}, or "{name}"'
    return None


def _resolved(resolve: Callable[..., T], text: str, node: NodeDescription, direction: Direction | None = None) -> T:
    try:
        return resolve(text, node.dictionary, node.profile.aliases)
    except UnknownName as unknown:
        unknown.direction = direction
        raise UsageError(str(unknown), node=node.node_id, hint=name_hint(unknown)) from unknown
    except ValueError as wrong:
        raise UsageError(str(wrong), node=node.node_id) from wrong
