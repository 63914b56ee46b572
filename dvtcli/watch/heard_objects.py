"""Values of nodes from recorded SDO transfers (CiA 301, 7.2.4.3).

Only the default SDO of each node (0x600 and 0x580 + node-ID). Block transfers are tracked to their end, not read.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import TYPE_CHECKING

from dvtcli.device.described_node import ToldValues
from dvtcli.domain.abort import Abort
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from dvtcli.domain.ports import Frame

Place = tuple[int, int]

_REQUESTS, _ANSWERS, _HEARTBEATS = 0x600, 0x580, 0x700
_SDO_BYTES = 8
#: heartbeat state of a boot-up message (CiA 301, 7.2.8.3.2.1)
_BOOT_UP = b"\x00"
_ABORT = 0x80
#: command specifiers of a client's requests
_DOWNLOADS_SEGMENT, _DOWNLOADS, _BLOCK_UPLOAD, _BLOCK_DOWNLOAD = 0, 1, 5, 6
#: and of a server's answers
_UPLOADED_SEGMENT, _SEGMENT_TAKEN, _UPLOADED, _TAKEN = 0, 1, 2, 3
_BLOCK_END = 0xA1
_STORE, _RESTORE, _WITH_PDOS = 0x1010, 0x1011, (1, 2)


class _Block(Enum):
    """Side that sends block segments, which begin with a number instead of a command."""

    NONE = auto()
    OF_CLIENT = auto()
    OF_SERVER = auto()


@dataclass(frozen=True, slots=True)
class HeardValues(ToldValues):
    """Received *values* of a node, with the same interface as the node."""

    node_id: int
    values: Mapping[Place, bytes]

    def told(self, index: int, sub_index: int) -> bytes:
        """The last received value. Raises SdoAborted if none was received."""
        if (index, sub_index) not in self.values:
            raise SdoAborted(index, sub_index, Abort.NO_SUB_INDEX, node=self.node_id)
        return self.values[index, sub_index]


@dataclass(frozen=True, slots=True)
class _ObservedTransfer:
    """Received bytes of an object's value; *whole* if complete."""

    place: Place
    data: bytes
    whole: bool


@dataclass(slots=True)
class _Heard:
    """A node: its values, its stored values, and its present transfer."""

    values: dict[Place, bytes] = field(default_factory=dict)
    stored: dict[Place, bytes] = field(default_factory=dict)
    down: _ObservedTransfer | None = None
    up: _ObservedTransfer | None = None
    block: _Block = _Block.NONE
    #: tracked indices; empty: all
    only: frozenset[int] = frozenset()

    def request(self, data: bytes) -> None:
        """Process a client's frame. A download counts once the node has accepted it."""
        if self.block is _Block.OF_CLIENT and data[0] != _ABORT:
            return
        command = data[0] >> 5
        if command == _DOWNLOADS_SEGMENT:
            self.down = _longer(self.down, data)
            return
        if command == _BLOCK_UPLOAD and data[0] != _BLOCK_END:
            self.block = _Block.OF_SERVER
        else:
            self.block = _Block.OF_CLIENT if command == _BLOCK_DOWNLOAD else _Block.NONE
        self.down = self._first(data) if command == _DOWNLOADS else None

    def answer(self, data: bytes) -> Place | None:
        """Process a node's frame; return the object whose value is complete now."""
        if self.block is _Block.OF_SERVER and data[0] != _ABORT:
            return None
        command, done = data[0] >> 5, None
        if self.block is _Block.OF_CLIENT and (command != _BLOCK_UPLOAD or data[0] == _BLOCK_END):
            self.block = _Block.NONE
        if command in (_UPLOADED, _UPLOADED_SEGMENT):
            self.up = done = self._first(data) if command == _UPLOADED else _longer(self.up, data)
        elif command == _TAKEN and self.down and self.down.place == _place(data) and not self.down.whole:
            return None  # the first answer of a download in segments
        elif command in (_TAKEN, _SEGMENT_TAKEN):
            done = self.down
        else:
            self.up = self.down = None
            self.block = _Block.NONE if data[0] == _ABORT else self.block
        if done is None or not done.whole or (command == _TAKEN and done.place != _place(data)):
            return None
        self.up = self.down = None
        self._hold(done, written=command in (_TAKEN, _SEGMENT_TAKEN))
        return done.place

    def _first(self, data: bytes) -> _ObservedTransfer | None:
        """The transfer that begins with *data*; None for an object that is not tracked."""
        return _first(data) if not self.only or _place(data)[0] in self.only else None

    def _hold(self, done: _ObservedTransfer, *, written: bool) -> None:
        index, sub_index = done.place
        if written and index in (_STORE, _RESTORE):
            if sub_index in _WITH_PDOS:
                self.stored = dict(self.values) if index == _STORE else {}
            return
        self.values[done.place] = done.data

    def start(self) -> None:
        """Process a start of the node: stored values remain, all others are unknown."""
        self.values = dict(self.stored)
        self.down = self.up = None
        self.block = _Block.NONE


class HeardObjects:
    """Track the SDO transfers of all nodes: for objects with indices in *only*, or for all."""

    def __init__(self, only: Collection[int] = ()) -> None:
        self._only = frozenset(only)
        self._nodes: dict[int, _Heard] = {}

    def take(self, frame: Frame) -> tuple[int, Place] | None:
        """Process *frame*; return node and object with a new known value, None for any other frame."""
        if frame.extended or frame.remote or not frame.can_id & 0x7F:
            return None
        service, node_id = frame.can_id & 0x780, frame.can_id & 0x7F
        if is_boot_up(frame) and node_id in self._nodes:
            self._nodes[node_id].start()
        if service not in (_REQUESTS, _ANSWERS) or len(frame.data) != _SDO_BYTES:
            return None
        node = self._nodes.setdefault(node_id, _Heard(only=self._only))
        if service == _REQUESTS:
            node.request(frame.data)
            return None
        place = node.answer(frame.data)
        return None if place is None else (node_id, place)

    def values(self, node_id: int) -> HeardValues:
        """Values of node *node_id* received so far."""
        return HeardValues(node_id, self._nodes[node_id].values if node_id in self._nodes else {})

    @property
    def node_ids(self) -> list[int]:
        """Nodes with requests or answers, in order."""
        return sorted(self._nodes)


def is_boot_up(frame: Frame) -> bool:
    """Whether *frame* is a boot-up message."""
    if frame.extended or frame.remote or not frame.can_id & 0x7F:
        return False
    return frame.can_id & 0x780 == _HEARTBEATS and frame.data == _BOOT_UP


def is_taken(frame: Frame) -> bool:
    """Whether the value from `HeardObjects.take` for *frame* was written; otherwise it was read."""
    return frame.data[0] >> 5 in (_TAKEN, _SEGMENT_TAKEN)


def _place(data: bytes) -> Place:
    return int.from_bytes(data[1:3], "little"), data[3]


def _first(data: bytes) -> _ObservedTransfer:
    """The first frame of a transfer, with up to four bytes if expedited."""
    expedited, sized = bool(data[0] & 2), bool(data[0] & 1)
    unused = data[0] >> 2 & 3 if expedited and sized else 0
    return _ObservedTransfer(_place(data), data[4 : _SDO_BYTES - unused] if expedited else b"", expedited)


def _longer(transfer: _ObservedTransfer | None, data: bytes) -> _ObservedTransfer | None:
    """*transfer* with a further segment; None if the transfer is unknown."""
    if transfer is None or transfer.whole:
        return None
    piece = data[1 : _SDO_BYTES - (data[0] >> 1 & 7)]
    return replace(transfer, data=transfer.data + piece, whole=bool(data[0] & 1))
