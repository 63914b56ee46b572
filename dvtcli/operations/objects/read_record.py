"""A record or an array, read with all its sub-indices. Only reads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.abort import Abort
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.objects import PROGRAM_DATA
from dvtcli.domain.standard_objects import is_pdo_mapping, standard_name
from dvtcli.domain.text import join_some
from dvtcli.errors import SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.results.values import EntryUnread, RecordRead
from dvtcli.operations.values.named_objects import means_whole, object_at
from dvtcli.operations.values.object_values import value_result

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.results import ValueRead
    from dvtcli.operations.session.session import SessionNodes

_DOMAIN = BY_SHORT_NAME["domain"]
#: maximum sub-index of a record (CiA 301, 7.4.1), and maximum entries of a PDO's mapping
_MOST, _MOST_MAPPED = 254, 64
_TOO_LONG = "a DOMAIN is read alone, into a file"


def read_whole(node: ReadableNode, text: str, data_type: DataType | None = None) -> RecordRead | ValueRead:
    """Read the record *text*: sub-index 0, and the entries up to it, as *data_type* or the file's type.

    If sub-index 0 is not a count (the object is not a record), its value is returned. Raises SdoAborted if sub-index 0
    is refused; a refused entry is part of the result, a missing entry is left out.
    """
    return _whole(node, object_at(node, text)[0], data_type)


def record_at(node: ReadableNode, index: int, data_type: DataType | None = None) -> RecordRead:
    """Read the record at *index*; raises UsageError if it is not a record."""
    found = _whole(node, index, data_type)
    if not isinstance(found, RecordRead):
        raise UsageError(f"0x{index:04X} is not a record: sub-index 0 holds no count", node=node.node_id)
    return found


def _whole(node: ReadableNode, index: int, data_type: DataType | None) -> RecordRead | ValueRead:
    count = node.upload(index, 0)
    head = value_result(node, index, 0, count, None)
    if len(count) != 1:
        return head if data_type is None else value_result(node, index, 0, count, data_type)
    entries = tuple(_entries(node, index, count[0]))
    if data_type is not None:
        entries = _as_type(node, entries, data_type)
    return RecordRead(head, entries)


def _as_type(
    node: NodeDescription, entries: tuple[ValueRead | EntryUnread, ...], data_type: DataType
) -> tuple[ValueRead | EntryUnread, ...]:
    """Decode *entries* as *data_type*; SdoProtocolError names all that do not fit."""
    found, wrong = list(entries), []
    for number, entry in enumerate(entries):
        if isinstance(entry, EntryUnread):
            continue
        index, sub_index = (int(part, 16) for part in entry.object.split(":"))
        try:
            found[number] = replace(value_result(node, index, sub_index, entry.raw, data_type), name=entry.name)
        except SdoProtocolError:
            wrong.append(f"{entry.object} ({len(entry.raw)} bytes)")
    if wrong:
        raise SdoProtocolError(
            f"{data_type.short} does not fit {join_some(wrong)}",
            node=node.node_id,
            hint=Hint(Action.GIVE, {"as_type": None}, "read one of them with {}"),
        )
    return tuple(found)


def _entries(node: ReadableNode, index: int, count: int) -> Iterator[ValueRead | EntryUnread]:
    most = _MOST_MAPPED if is_pdo_mapping(index) else _MOST  # a count of 254 or 255 says that it is an MPDO
    for sub_index in range(1, min(count, most) + 1):
        if _is_domain(node, index, sub_index):
            yield EntryUnread(f"{index:04X}:{sub_index:02X}", _name(node, index, sub_index), None, _TOO_LONG)
            continue
        try:
            data = node.upload(index, sub_index)
        except SdoAborted as refused:
            if refused.abort != Abort.NO_SUB_INDEX:
                name = _name(node, index, sub_index)
                yield EntryUnread(f"{index:04X}:{sub_index:02X}", name, refused.abort)
            continue
        yield replace(value_result(node, index, sub_index, data, None), name=_name(node, index, sub_index))


def _is_domain(node: NodeDescription, index: int, sub_index: int) -> bool:
    entry = node.dictionary.entry(index, sub_index) if node.dictionary is not None else None
    return index == PROGRAM_DATA if entry is None else entry.data_type == _DOMAIN


def _name(node: NodeDescription, index: int, sub_index: int) -> str:
    known = node.dictionary.display_name(index, sub_index) if node.dictionary is not None else ""
    return known or standard_name(index, sub_index)


def read_object(
    session: SessionNodes, object_: str, data_type: DataType | None = None, node_id: int | None = None
) -> ValueRead | RecordRead:
    """Read *object_* (`6C01:1`, `statusword`…) of node *node_id* or the selected node.

    *data_type* replaces the file's type. `1018` is the whole record, with *data_type* for each entry, `1018:0` its
    highest sub-index. Raises UsageError for an unknown name, SdoAborted if the device refuses, NoAnswer if silent.
    """
    node = session.node(node_id)
    if means_whole(node, object_):
        return read_whole(node, object_, data_type)
    index, sub_index = object_at(node, object_)
    return value_result(node, index, sub_index, node.upload(index, sub_index), data_type)
