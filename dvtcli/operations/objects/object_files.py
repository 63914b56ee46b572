"""Transfer objects to and from files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dvtcli.bus.sdo.client import MOST_BYTES
from dvtcli.bus.sdo.sdo_link import ANSWER_ID, REQUEST_ID
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import read_input
from dvtcli.operations.objects.write_object import write_bytes
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, place_of
from dvtcli.operations.session.whole_file import write_whole
from dvtcli.operations.values.named_objects import object_at, refuse_whole

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser


_SEGMENT_BYTES, _EACH = 7, 64
#: responses that begin an upload with its size, by their bits: segmented, block
_SIZE_TOLD = ((0xE3, 0x41), (0xE3, 0xC2))


@contextmanager
def transfer_progress(session: SessionNodes, node_id: int, text: str, size: int | None = None) -> Iterator[None]:
    """Report the progress of a transfer during a block: *text*, and how much of *size* bytes; the bus is open.

    None is for an upload: its size is learnt on the way.
    """
    watch = _FrameCount(session, node_id, text, size)
    stop = session.wire.tap(watch.take)
    try:
        yield
    finally:
        stop()


class _FrameCount:
    """Counts the frames of a node's SDO channel."""

    def __init__(self, session: SessionUser, node_id: int, text: str, size: int | None) -> None:
        self._tell, self._text, self._size = session.reporter, text, size or 0
        self._carrier = (REQUEST_ID if size is not None else ANSWER_ID) + node_id
        self._learns_size = size is None
        self._count = 0

    def take(self, frame: Frame, _sent: bool) -> None:
        """Count a frame (Tap); slightly too many, by a transfer's begin, end and repetitions."""
        if frame.can_id != self._carrier or len(frame.data) != 8:
            return
        if self._learns_size and any(frame.data[0] & mask == bits for mask, bits in _SIZE_TOLD) and self._count < 2:
            self._size, self._count = int.from_bytes(frame.data[4:], "little"), 0
        self._count += 1
        if self._count % _EACH == 0:
            done = min(self._count * _SEGMENT_BYTES, self._size) if self._size else 0
            of = f" of {self._size:,} bytes" if self._size else ""
            self._tell.progress(f"{self._text}: {done:,}{of}", done, self._size)


def read_to_file(session: SessionNodes, object_: str, file: str, node_id: int | None = None) -> Facts:
    """Read *object_* of node *node_id* or the selected node, and write its bytes to *file*, all or none.

    Asks before overwriting. Raises UsageError for an unknown name or an unwritable file; SdoAborted, NoAnswer.
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


def write_from_file(session: SessionNodes, node: Node, index: int, sub_index: int, file: str) -> Changed:
    """Write the bytes of *file* to an object like `write`: verified, or rolled back.

    Raises UsageError if the file cannot be read, InputFileError if it is empty or larger than any object.
    """
    data = file_bytes(file)
    text = f"node {node.node_id}: writing 0x{index:04X}:{sub_index:02X}"
    with transfer_progress(session, node.node_id, text, len(data)):
        return write_bytes(session, node, index, sub_index, data)


def file_bytes(file: str) -> bytes:
    """Read *file*; raises UsageError if unreadable, InputFileError if empty or too large."""
    try:
        data = read_input(file, MOST_BYTES, "object")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
    if not data:
        raise InputFileError(f"{file} is empty", place=file)
    return data
