"""SDO transfers followed frame by frame (CiA 301, 7.2.4.3): expedited, in segments and by blocks. Pure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

#: index and sub-index
Place = tuple[int, int]
#: the server's node-ID, None if unknown, and its name of the pair of CAN-IDs
Channel = tuple[int | None, str]
#: bytes of an SDO frame, and the first byte of an abort
SDO_BYTES, ABORT = 8, 0x80
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
    `abort`, or `unknown`. *is_write* and *place* (index, sub-index) are
    None if the beginning is missing. *data* is the value
    if complete, else the frame's own bytes; *size* is the value's length if known, *position* the bytes so far.
    *code* is the abort code, *way* is `expedited`, `segments` or `blocks`, empty if unknown.
    """

    step: str
    is_write: bool | None = None
    place: Place | None = None
    data: bytes = b""
    size: int | None = None
    position: int = 0
    code: int = 0
    way: str = ""

    @property
    def object(self) -> str:
        """The object: `6060:00`; empty if unknown."""
        return f"{self.place[0]:04X}:{self.place[1]:02X}" if self.place is not None else ""


UNKNOWN = SdoStep("unknown")


@dataclass(slots=True)
class _Transfer:
    """A running transfer: the object, the bytes so far, and the segments of the present block by number.

    *is_whole*: the last byte was sent; *is_in_block*: the next frames in the value's direction are a block's segments.
    """

    is_write: bool
    place: Place
    size: int | None = None
    way: str = "segments"
    data: bytearray = field(default_factory=bytearray)
    count: int = 0
    is_whole: bool = False
    is_in_block: bool = False
    block: dict[int, bytes] = field(default_factory=dict)
    last: int = 0

    def step(self, step: str, data: bytes = b"", more: int = 0) -> SdoStep:
        size = self.count if step == "done" else self.size
        return SdoStep(step, self.is_write, self.place, data, size, self.count + more, way=self.way)

    def done(self) -> SdoStep:
        return self.step("done", bytes(self.data))

    def answered(self) -> SdoStep:
        """The server's first answer: the end of an expedited transfer."""
        return self.done() if self.is_whole else self.step("accepted")

    def add(self, data: bytes) -> None:
        self.count += len(data)
        self.data += data[: max(0, MOST_KEPT - len(self.data))]

    def segment(self, data: bytes) -> SdoStep:
        """Take a segment."""
        piece = data[1 : SDO_BYTES - (data[0] >> 1 & 7)]
        self.add(piece)
        self.is_whole = bool(data[0] & 1)
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
        self.block[number] = data[1:]
        self.last = number if data[0] & _LAST_OF_BLOCK else 0
        return self.step("segment", data[1:], sum(map(len, self.block.values())))

    def _block_taken(self, number: int) -> SdoStep:
        """Take the segments up to *number*; the next block begins behind it."""
        for each in range(1, number + 1):
            self.add(self.block.get(each, b""))
        self.is_in_block = not (self.last and number >= self.last)
        self.block, self.last = {}, 0
        return self.step("next")

    def end_of_blocks(self, data: bytes) -> SdoStep:
        """Remove the bytes of the last segment that are not used."""
        self.count = max(0, self.count - (data[0] >> 2 & 7))
        del self.data[self.count :]
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


class SdoTransfers:
    """Follow the transfers of any number of channels, each a pair of CAN-IDs between a client and a server."""

    def __init__(self) -> None:
        self._running: dict[Channel, _Transfer] = {}

    def forget(self, node: int | None) -> None:
        """Drop the transfers of *node*, as after its boot-up."""
        for channel in [channel for channel in self._running if channel[0] == node]:
            del self._running[channel]

    def take(self, channel: Channel, data: bytes, *, request: bool) -> SdoStep:
        """Process the next frame of *channel*: a client's *request*, or a server's answer."""
        if len(data) < SDO_BYTES:
            return UNKNOWN
        running = self._running.get(channel)
        if data[0] == ABORT:
            step = _aborted(running, data)
        elif running is not None and running.is_in_block and running.is_write == request:
            return running.block_segment(data)
        elif (begun := _begun(data) if request else _uploaded(data)) is not None:
            running = self._running[channel] = begun
            step = running.step("start", bytes(running.data)) if request else running.answered()
        elif not request and data[0] >> 5 == _DOWNLOADED:
            is_known = running is not None and running.place == _place(data)
            step = running.answered() if running and is_known else SdoStep("done", True, _place(data))
        else:
            step = _goes_on(running, data, request=request)
        if step.step in ("done", "abort"):
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
        found.way = "expedited"
        found.add(data[4 : SDO_BYTES - (data[0] >> 2 & 3 if data[0] & 1 else 0)])
    return found


def _place(data: bytes) -> Place:
    return int.from_bytes(data[1:3], "little"), data[3]


def _size(data: bytes, bit: int) -> int | None:
    return int.from_bytes(data[4:8], "little") if data[0] & bit else None
