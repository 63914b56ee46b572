"""SDO transfers followed frame by frame, and the values in them (CiA 301, 7.2.4.3). Pure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.described_node import KnownValues
from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import HEARTBEAT_BASE, SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.profile import ObjectAddress
from dvtcli.errors import SdoAborted
from dvtcli.watch.service_words import SDO_BYTES

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from dvtcli.domain.ports import Frame

#: the server's node-ID, None if unknown, and its name of the pair of CAN-IDs
Channel = tuple[int | None, str]
#: the first byte of an abort
ABORT = 0x80
#: the most bytes of a value that are kept
MOST_KEPT = 65_536
#: command specifiers of a client's requests
_DOWNLOAD_SEGMENT, _DOWNLOAD, _UPLOAD, _UPLOAD_SEGMENT, _, _BLOCK_UPLOAD, _BLOCK_DOWNLOAD = range(7)
#: and of a server's answers
_UPLOADED_SEGMENT, _SEGMENT_TAKEN, _UPLOADED, _DOWNLOADED, _, _BLOCK_DOWNLOADED, _BLOCK_UPLOADED = range(7)
#: subcommands of block transfers
_INITIATE, _END, _TAKEN, _START = range(4)
_LAST_OF_BLOCK, _SEGMENT_NUMBER = 0x80, 0x7F


class SdoStep(NamedTuple):
    """What a frame is in a transfer.

    *step* is `start`, `accepted`, `segment`, `next` (a segment was taken, or is asked for), `end` (of blocks), `done`,
    `incomplete` (it ended, but its segments do not fit), `abort`, or `unknown`. *is_write* and *place* (index,
    sub-index) are None if the beginning is missing. *data* is the value if complete, else the frame's
    own bytes; *size* is the value's length if known, *position* the bytes so far.
    *code* is the abort code, *way* is `expedited`, `segments` or `blocks`, empty if unknown.
    *is_padded*: the value may be shorter than *data*, since the frame does not say its length.
    """

    step: str
    is_write: bool | None = None
    place: ObjectAddress | None = None
    data: bytes = b""
    size: int | None = None
    position: int = 0
    code: int = 0
    way: str = ""
    is_padded: bool = False

    @property
    def object(self) -> str:
        """The object: `6060:00`; empty if unknown."""
        return f"{self.place[0]:04X}:{self.place[1]:02X}" if self.place is not None else ""

    @property
    def has_whole_value(self) -> bool:
        """Whether *data* is a complete value that the node has now: it gave it, or accepted it."""
        return self.step == "done" and self.place is not None and self.size is not None and self.size == len(self.data)


UNKNOWN = SdoStep("unknown")


@dataclass(slots=True)
class _Transfer:
    """A running transfer: the object, the bytes so far, and the segments of the present block by number.

    *is_whole*: the last byte was sent; *is_in_block*: the next frames in the value's direction are a block's segments.
    *toggle* is the toggle bit that the next segment is to have, *before* the last segment. *is_broken*: one is missing.
    """

    is_write: bool
    place: ObjectAddress
    size: int | None = None
    way: str = "segments"
    data: bytearray = field(default_factory=bytearray)
    count: int = 0
    is_whole: bool = False
    is_in_block: bool = False
    block: dict[int, bytes] = field(default_factory=dict)
    last: int = 0
    toggle: int = 0
    before: bytes = b""
    is_broken: bool = False
    is_padded: bool = False

    def step(self, step: str, data: bytes = b"", more: int = 0) -> SdoStep:
        size = self.count if step == "done" else self.size
        return SdoStep(step, self.is_write, self.place, data, size, self.count + more, 0, self.way, self.is_padded)

    def done(self) -> SdoStep:
        """The end: with the value if all segments fit and the count is the announced size."""
        is_ended = self.is_whole or self.way != "blocks"
        if self.is_broken or not is_ended or self.size not in (None, self.count):
            return self.step("incomplete")
        return self.step("done", bytes(self.data))

    def answered(self) -> SdoStep:
        """The server's first answer: the end of an expedited transfer."""
        return self.done() if self.is_whole else self.step("accepted")

    def add(self, data: bytes) -> None:
        self.count += len(data)
        self.data += data[: max(0, MOST_KEPT - len(self.data))]

    def segment(self, data: bytes) -> SdoStep:
        """Take a segment; the same one again adds nothing."""
        piece, toggle = data[1 : SDO_BYTES - (data[0] >> 1 & 7)], data[0] >> 4 & 1
        if toggle != self.toggle and data == self.before:
            # without a size, it may as well be an equal one behind a missing one
            self.is_broken = self.is_broken or (self.size is None and not self.is_whole)
            return self.step("segment", piece)
        self.is_broken = self.is_broken or self.is_whole or toggle != self.toggle
        self.add(piece)
        self.is_whole, self.toggle, self.before = bool(data[0] & 1), toggle ^ 1, data
        return self.step("segment", piece)

    def uploaded_segment(self, data: bytes) -> SdoStep:
        """Take a server's segment, the last of which completes the value."""
        step = self.segment(data)
        return self.done() if self.is_whole else step

    def go_on(self, _data: bytes) -> SdoStep:
        """Take the request for a segment, or the answer to it."""
        return self.done() if self.is_write and self.is_whole else self.step("next")

    def block_segment(self, data: bytes) -> SdoStep:
        """Keep a segment of a block until the other side says how many it took."""
        number = data[0] & _SEGMENT_NUMBER
        self.is_broken = self.is_broken or number in self.block
        self.block[number] = data[1:]
        self.last = number if data[0] & _LAST_OF_BLOCK else 0
        return self.step("segment", data[1:], sum(map(len, self.block.values())))

    def _block_taken(self, number: int) -> SdoStep:
        """Take the segments up to *number*; the next block begins behind it."""
        for each in range(1, number + 1):
            self.is_broken = self.is_broken or each not in self.block
            self.add(self.block.get(each, b""))
        self.is_in_block = not (self.last and number >= self.last)
        self.block, self.last = {}, 0
        return self.step("next")

    def end_of_blocks(self, data: bytes) -> SdoStep:
        """Remove the bytes of the last segment that are not used; a repeated end changes nothing."""
        if self.is_whole:
            return self.step("end")
        self.count = max(0, self.count - (data[0] >> 2 & 7))
        del self.data[self.count :]
        self.is_whole = True
        return self.step("end")

    def client_takes_blocks(self, data: bytes) -> SdoStep:
        """Take a client's start of blocks, its answer to a block, or the end."""
        if data[0] & 3 == _TAKEN:
            return self._block_taken(data[1])
        self.is_in_block = data[0] & 3 == _START
        return self.done() if data[0] & 3 == _END else self.step("next")

    def server_sends_blocks(self, data: bytes) -> SdoStep:
        """Take a server's first answer, or its end of blocks."""
        if data[0] & 1 == _END:
            return self.end_of_blocks(data)
        self.size = _size(data, bit=2)
        return self.step("accepted")

    def server_takes_blocks(self, data: bytes) -> SdoStep:
        """Take a server's first answer, its answer to a block, or the end."""
        if data[0] & 3 == _TAKEN:
            return self._block_taken(data[1])
        self.is_in_block = data[0] & 3 == _INITIATE
        return self.done() if data[0] & 3 == _END else self.step("accepted")


#: what a frame of a running transfer is: a request or not, of a download or not, by blocks or not, command specifier
_GOES_ON: dict[tuple[bool, bool, bool, int], Callable[[_Transfer, bytes], SdoStep]] = {
    (True, True, False, _DOWNLOAD_SEGMENT): _Transfer.segment,
    (True, False, False, _UPLOAD_SEGMENT): _Transfer.go_on,
    (True, True, True, _BLOCK_DOWNLOAD): _Transfer.end_of_blocks,
    (True, False, True, _BLOCK_UPLOAD): _Transfer.client_takes_blocks,
    (False, False, False, _UPLOADED_SEGMENT): _Transfer.uploaded_segment,
    (False, True, False, _SEGMENT_TAKEN): _Transfer.go_on,
    (False, False, True, _BLOCK_UPLOADED): _Transfer.server_sends_blocks,
    (False, True, True, _BLOCK_DOWNLOADED): _Transfer.server_takes_blocks,
}


class _LastFrame(NamedTuple):
    """The last frame of a channel: its direction, its first byte, which numbers segments of blocks, and its object.

    *is_of_block*: its number is one more than that of the frame before it, with no answer between.
    """

    request: bool
    number: int
    place: bytes
    is_of_block: bool = False

    @classmethod
    def after(cls, last: _LastFrame | None, data: bytes, *, request: bool) -> _LastFrame:
        """Return the frame with *data*, sent after *last* on the same channel.

        Numbers that rise without a frame in the other direction are a block's segments; answers of two servers about
        one object are not.
        """
        number, place = data[0], data[1:4]
        if last is None or last.request != request or data[0] == ABORT:
            return cls(request, number, place)
        if last.is_of_block:
            number &= _SEGMENT_NUMBER
            return cls(request, number, place, number > last.number)
        is_next = 1 < number == last.number + 1 < ABORT
        return cls(request, number, place, is_next and (request or place != last.place or not any(place)))


class SdoTransfers:
    """Follow the transfers of any number of channels, each a pair of CAN-IDs between a client and a server."""

    def __init__(self) -> None:
        self._running: dict[Channel, _Transfer] = {}
        self._last: dict[Channel, _LastFrame] = {}

    def drop(self, node: int | None) -> None:
        """Drop the transfers of *node*, as after its boot-up."""
        for channel in [channel for channel in self._running if channel[0] == node]:
            del self._running[channel]
        for channel in [channel for channel in self._last if channel[0] == node]:
            del self._last[channel]

    def take(self, channel: Channel, data: bytes, *, request: bool) -> SdoStep:
        """Process the next frame of *channel*: a client's *request*, or a server's answer."""
        if len(data) < SDO_BYTES:
            return UNKNOWN
        running = self._running.get(channel)
        last = self._last[channel] = _LastFrame.after(self._last.get(channel), data, request=request)
        if data[0] == ABORT:
            step = _aborted(running, data)
        elif running is not None and running.is_in_block and running.is_write == request:
            return running.block_segment(data)
        elif last.is_of_block and (running is None or data[0] >> 5):
            self._running.pop(channel, None)
            return UNKNOWN
        elif (begun := _begun(data) if request else _uploaded(data)) is not None:
            running = self._running[channel] = begun
            step = running.step("start", bytes(running.data)) if request else running.answered()
        elif not request and data[0] >> 5 == _DOWNLOADED:
            is_known = running is not None and running.place == _place(data)
            step = running.answered() if running and is_known else SdoStep("done", True, _place(data))
        else:
            step = _goes_on(running, data, request=request)
        if step.step in ("done", "incomplete", "abort"):
            self._running.pop(channel, None)
        return step


def _goes_on(running: _Transfer | None, data: bytes, *, request: bool) -> SdoStep:
    if running is None:
        return UNKNOWN
    take = _GOES_ON.get((request, running.is_write, running.way == "blocks", data[0] >> 5))
    return UNKNOWN if take is None else take(running, data)


def _aborted(running: _Transfer | None, data: bytes) -> SdoStep:
    place = _place(data)
    is_write = running.is_write if running and running.place == place else None
    return SdoStep("abort", is_write, place, code=int.from_bytes(data[4:8], "little"))


def _begun(data: bytes) -> _Transfer | None:
    """The transfer that a request begins."""
    command = data[0] >> 5
    if command == _DOWNLOAD:
        return _first(data, is_write=True)
    if command == _UPLOAD:
        return _Transfer(False, _place(data))
    if command == _BLOCK_DOWNLOAD and not data[0] & _END:
        return _Transfer(True, _place(data), _size(data, bit=2), way="blocks")
    if command == _BLOCK_UPLOAD and data[0] & 3 == _INITIATE:
        return _Transfer(False, _place(data), way="blocks")
    return None


def _uploaded(data: bytes) -> _Transfer | None:
    """The transfer that a server's answer to an upload begins: with the value, or its length."""
    return _first(data, is_write=False) if data[0] >> 5 == _UPLOADED else None


def _first(data: bytes, *, is_write: bool) -> _Transfer:
    """The transfer of the first frame with a value of up to four bytes, or with the length of a longer value."""
    is_whole = bool(data[0] & 2)
    found = _Transfer(is_write, _place(data), None if is_whole else _size(data, bit=1), is_whole=is_whole)
    if is_whole:
        found.way, found.is_padded = "expedited", not data[0] & 1
        found.add(data[4 : SDO_BYTES - (data[0] >> 2 & 3 if data[0] & 1 else 0)])
    return found


def _place(data: bytes) -> ObjectAddress:
    return int.from_bytes(data[1:3], "little"), data[3]


def _size(data: bytes, bit: int) -> int | None:
    return int.from_bytes(data[4:8], "little") if data[0] & bit else None


#: heartbeat state of a boot-up message (CiA 301, 7.2.8.3.2.1)
_BOOT_UP = b"\x00"
_WITH_PDOS = (1, 2)


@dataclass(frozen=True, slots=True)
class ReceivedValues(KnownValues):
    """Received *values* of a node, with the same interface as the node."""

    node_id: int
    values: Mapping[ObjectAddress, bytes]

    def known_value(self, index: int, sub_index: int) -> bytes:
        """The last received value. Raises SdoAborted if none was received."""
        if (index, sub_index) not in self.values:
            raise SdoAborted(index, sub_index, Abort.NO_SUB_INDEX, node=self.node_id)
        return self.values[index, sub_index]


class ReceivedValue(NamedTuple):
    """A node's object of which a transfer was complete: written, or read."""

    node_id: int
    place: ObjectAddress
    is_written: bool


@dataclass(slots=True)
class _NodeValues:
    """The last values of a node, and those that it has stored."""

    last: dict[ObjectAddress, bytes] = field(default_factory=dict)
    stored: dict[ObjectAddress, bytes] = field(default_factory=dict)

    def hold(self, place: ObjectAddress, data: bytes, *, is_written: bool) -> None:
        """Hold *data*; a written 0x1010 or 0x1011 says what is stored."""
        index, sub_index = place
        if not is_written or index not in (STORE_PARAMETERS, RESTORE_PARAMETERS):
            self.last[place] = data
        elif sub_index in _WITH_PDOS:
            self.stored = dict(self.last) if index == STORE_PARAMETERS else {}


class ReceivedObjects:
    """Hold the last values of all nodes: of objects with indices in *only*, or of all."""

    def __init__(self, only: Collection[int] = ()) -> None:
        self._only = frozenset(only)
        self._nodes: dict[int, _NodeValues] = {}
        self._transfers = SdoTransfers()

    def take(self, frame: Frame) -> ReceivedValue | None:
        """Process *frame*; return the value that it completes. One with a missing segment is none."""
        if frame.extended or frame.remote or not frame.can_id & 0x7F:
            return None
        service, node_id = frame.can_id & 0x780, frame.can_id & 0x7F
        if is_boot_up(frame) and node_id in self._nodes:
            self._transfers.drop(node_id)
            self._nodes[node_id].last = dict(self._nodes[node_id].stored)
        if service not in (SDO_REQUEST_BASE, SDO_RESPONSE_BASE) or len(frame.data) != SDO_BYTES:
            return None
        node = self._nodes.setdefault(node_id, _NodeValues())
        step = self._transfers.take((node_id, "SDO"), frame.data, request=service == SDO_REQUEST_BASE)
        if not step.has_whole_value or step.place is None or (self._only and step.place[0] not in self._only):
            return None
        is_written = bool(step.is_write)
        node.hold(step.place, step.data, is_written=is_written)
        return ReceivedValue(node_id, step.place, is_written)

    def values(self, node_id: int) -> ReceivedValues:
        """Values of node *node_id* received so far."""
        return ReceivedValues(node_id, self._nodes[node_id].last if node_id in self._nodes else {})

    @property
    def node_ids(self) -> list[int]:
        """Nodes with requests or answers, in order."""
        return sorted(self._nodes)


def is_boot_up(frame: Frame) -> bool:
    """Whether *frame* is a boot-up message."""
    if frame.extended or frame.remote or not frame.can_id & 0x7F:
        return False
    return frame.can_id & 0x780 == HEARTBEAT_BASE and frame.data == _BOOT_UP
