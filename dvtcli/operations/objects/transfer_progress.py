"""How far a long SDO transfer has come, seen by its frames. Knows segments and blocks by their first bytes only.

Where a bus carries no frames, as a gateway's may, nothing is seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dvtcli.bus.sdo.sdo_link import ANSWER_ID, REQUEST_ID

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.session.session import Session

_SEGMENT_BYTES, _EACH = 7, 64
#: answers that begin an upload and tell its size, by their bits: in segments, by blocks
_SIZE_TOLD = ((0xE3, 0x41), (0xE3, 0xC2))


@contextmanager
def transfer_progress(session: Session, node_id: int, text: str, size: int | None = None) -> Iterator[None]:
    """While the block runs, say *text* with how much of *size* bytes has passed; the bus is open.

    None is for an upload: its size is told on the way.
    """
    watch = _FrameCount(session, node_id, text, size)
    stop = session.wire.tap(watch.take)
    try:
        yield
    finally:
        stop()


class _FrameCount:
    """The frames of one node's SDO channel, counted."""

    def __init__(self, session: Session, node_id: int, text: str, size: int | None) -> None:
        self._tell, self._text, self._size = session.tell, text, size or 0
        self._carrier = (REQUEST_ID if size is not None else ANSWER_ID) + node_id
        self._learns_size = size is None
        self._count = 0

    def take(self, frame: Frame, _sent: bool) -> None:
        """Count a frame as it passes (Tap); some more for a transfer's beginning and end, and what is sent again."""
        if frame.can_id != self._carrier or len(frame.data) != 8:
            return
        if self._learns_size and any(frame.data[0] & mask == bits for mask, bits in _SIZE_TOLD) and self._count < 2:
            self._size, self._count = int.from_bytes(frame.data[4:], "little"), 0
        self._count += 1
        if self._count % _EACH == 0:
            done = min(self._count * _SEGMENT_BYTES, self._size) if self._size else 0
            of = f" of {self._size:,} bytes" if self._size else ""
            self._tell.progress(f"{self._text}: {done:,}{of}", done, self._size)
