"""SYNC on a bus that nobody who is known sends: heard while nodes are read, or before they are written. Sends nothing.

Does not know why the bus is listened to.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_optional
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.ports import CanopenBus, Frame

_SYNC_ID, _USUAL, _PRODUCES, _CAN_ID = 0x1005, 0x080, 1 << 30, 0x7FF
_HEARTBEATS = range(0x701, 0x780)


@dataclass(slots=True)
class ShortFrames:
    """CAN-IDs of frames that may be SYNC, by their length: *heard* from others, and *sent* from here."""

    heard: set[int] = field(default_factory=set)
    sent: set[int] = field(default_factory=set)

    def note(self, frame: Frame, sent: bool) -> None:
        """*frame* passed; SYNC has no data, or a counter of one byte (CiA 301, 7.2.5)."""
        if len(frame.data) <= 1 and not frame.extended and not frame.remote and frame.can_id not in _HEARTBEATS:
            (self.sent if sent else self.heard).add(frame.can_id)


@contextmanager
def short_frames(bus: CanopenBus) -> Iterator[ShortFrames]:
    """Those that pass on *bus* while the block runs."""
    found = ShortFrames()
    end = bus.tap(found.note)
    try:
        yield found
    finally:
        end()


def unknown_syncs(frames: ShortFrames, nodes: Iterable[Node]) -> tuple[int, ...]:
    """CAN-IDs of SYNC that was heard, and that none of *nodes* sends by its 0x1005 (bit 30), nor anybody here.

    0x080, and whatever one of them waits for. Nothing is read where none was heard.
    """
    strange = frames.heard - frames.sent
    if not strange:
        return ()
    held: list[int] = []
    for node in nodes:
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):  # who is silent explains nothing
            held.append(read_optional(node.memory, _SYNC_ID, 0, 4) or 0)
    explained = {value & _CAN_ID for value in held if value & _PRODUCES}
    meant = {_USUAL, *(value & _CAN_ID for value in held)}
    return tuple(sorted(strange & meant - explained))


def sync_note(can_id: int) -> str:
    """What to say of one."""
    return f"SYNC 0x{can_id:03X} is heard, and no node here sends it (0x1005): somebody who is not known does"
