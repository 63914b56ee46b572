"""The type with which an object of a node is written; reads the object if no file has its type."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.rules.raw_write import parameter_size
from dvtcli.errors import DvtcliError
from dvtcli.operations.values.object_values import type_of

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.datatypes import DataType


def object_type(node: ReadableNode, index: int, sub_index: int) -> DataType:
    """Return the type for writing; raises DvtcliError with a hint if unreadable and unknown."""
    return type_of(node, index, sub_index, _size(node, index, sub_index))


def _size(node: ReadableNode, index: int, sub_index: int) -> int:
    """Return the object's length in bytes, 0 for a type without fixed length; raises as reading it, with a hint."""
    if Pdo.at(index) is not None:
        return parameter_size(index, sub_index) or 4
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    if entry is not None and entry.data_type is not None:
        return entry.data_type.size or 0
    try:
        return len(node.upload(index, sub_index))
    except DvtcliError as failed:
        failed.hint = failed.hint or Hint(
            Action.GIVE, {"as_type": "TYPE"}, "says how to write an object that cannot be read"
        )
        raise
