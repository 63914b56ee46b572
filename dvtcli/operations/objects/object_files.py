"""Objects as files: what one holds into a file, and what a file holds into an object. Does not know what is in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.bus.sdo.client import MOST_BYTES
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import read_input
from dvtcli.operations.meanings.named_objects import object_at, refuse_whole
from dvtcli.operations.objects.transfer_progress import transfer_progress
from dvtcli.operations.objects.write_object import write_bytes
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, place_of
from dvtcli.operations.session.whole_file import write_whole

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session


def read_to_file(session: Session, object_: str, file: str, node_id: int | None = None) -> Facts:
    """Read *object_* of node *node_id* or the selected one, and write its bytes into *file*, all of them or none.

    Asks before it overwrites. UsageError for an unknown name, or a file that cannot be written; SdoAborted, NoAnswer.
    """
    path = place_of(file, "NAME.bin")
    node = session.node(node_id)
    refuse_whole(node, object_)
    index, sub_index = object_at(node, object_)
    ask_before_overwriting(session, path)
    place = f"{index:04X}:{sub_index:02X}"
    with transfer_progress(session, node.node_id, f"node {node.node_id}: reading 0x{place}"):
        data = node.upload(index, sub_index)
    write_whole(path, data)
    session.made.append(file)
    rows = (("node", node.node_id), ("object", place), ("file", file), ("bytes", len(data)))
    return Facts("object-file", rows, (f"{file}: {len(data):,} bytes of 0x{place} of node {node.node_id}",))


def write_from_file(session: Session, node: Node, index: int, sub_index: int, file: str) -> Changed:
    """Write the bytes of *file* to an object as `write` does, read them back, and put the old ones back otherwise.

    UsageError where the file cannot be read, InputFileError where it is empty or larger than any object.
    """
    data = file_bytes(file)
    text = f"node {node.node_id}: writing 0x{index:04X}:{sub_index:02X}"
    with transfer_progress(session, node.node_id, text, len(data)):
        return write_bytes(session, node, index, sub_index, data)


def file_bytes(file: str) -> bytes:
    """What *file* holds; UsageError where it cannot be read, InputFileError where it is empty or too large."""
    try:
        data = read_input(file, MOST_BYTES, "object")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
    if not data:
        raise InputFileError(f"{file} is empty", place=file)
    return data
