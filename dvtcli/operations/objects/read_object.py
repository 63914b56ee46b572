"""One object of a node, read by SDO upload and decoded; a record with all its sub-indices."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.operations.meanings.named_objects import means_whole, object_at
from dvtcli.operations.meanings.object_values import value_result

if TYPE_CHECKING:
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.results import RecordRead, ValueRead
    from dvtcli.operations.session.session import Session


def read_object(
    session: Session, object_: str, data_type: DataType | None = None, node_id: int | None = None
) -> ValueRead | RecordRead:
    """Read *object_* (`6C01:1`, `statusword`…) of node *node_id* or the selected one, as *data_type* or the file's own.

    `1018` is the whole record, `1018:0` its highest sub-index; *data_type* is then that of each entry.
    UsageError for an unknown name, SdoAborted where the device refuses, NoAnswer where it is silent.
    """
    node = session.node(node_id)
    if means_whole(node, object_):
        from dvtcli.operations.objects.read_record import read_whole

        return read_whole(node, object_, data_type)
    index, sub_index = object_at(node, object_)
    return value_result(node, index, sub_index, node.upload(index, sub_index), data_type)
