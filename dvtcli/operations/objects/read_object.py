"""Read an object of a node by SDO upload and decode it; a record with all sub-indices."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.operations.meanings.named_objects import means_whole, object_at
from dvtcli.operations.meanings.object_values import value_result

if TYPE_CHECKING:
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.results import RecordRead, ValueRead
    from dvtcli.operations.session.session_nodes import SessionNodes


def read_object(
    session: SessionNodes, object_: str, data_type: DataType | None = None, node_id: int | None = None
) -> ValueRead | RecordRead:
    """Read *object_* (`6C01:1`, `statusword`…) of node *node_id* or the selected node.

    *data_type* replaces the file's type. `1018` is the whole record, with *data_type* for each entry, `1018:0` its
    highest sub-index. Raises UsageError for an unknown name, SdoAborted if the device refuses, NoAnswer if silent.
    """
    node = session.node(node_id)
    if means_whole(node, object_):
        from dvtcli.operations.objects.read_record import read_whole

        return read_whole(node, object_, data_type)
    index, sub_index = object_at(node, object_)
    return value_result(node, index, sub_index, node.upload(index, sub_index), data_type)
