"""SDO block transfer server: sub-blocks, acknowledgements, retransmission and CRC (CiA 301, 7.2.4.3.9 ff.).

A transfer takes requests of eight bytes and returns responses, without a time-out: a client that stops inside a sub-
block must abort before another request.
"""

from __future__ import annotations

from binascii import crc_hqx
from typing import Protocol

from dvtcli.domain.abort import Abort
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice

_BLOCK_UPLOAD = 5
_MOST_SEGMENTS, _SEGMENT_BYTES = 127, 7
_MOST_BYTES = 1 << 20
_LAST = 0x80
_CRC = 0x04


class ServedBlockTransfer(Protocol):
    """A block transfer in progress; *multiplexer* is index and sub-index as on the wire."""

    multiplexer: bytes
    finished: bool

    def takes(self, request: bytes) -> bool:
        """True if *request* belongs to this transfer."""
        ...

    def handle(self, request: bytes) -> list[bytes]:
        """The responses to *request*. Raises Refusal if the transfer is aborted."""
        ...


class ServedBlockDownload:
    """A block download initiated by *request*. Raises Refusal if the object can never be written."""

    def __init__(self, device: StrictDevice, request: bytes) -> None:
        if request[0] & 0x01:
            raise Refusal(Abort.COMMAND_SPECIFIER)
        self.multiplexer = request[1:4]
        self.finished = False
        self._device = device
        self._block_size = device.family.block_size
        self._knows_crc = _CRC if device.family.block_crc else 0
        self._crc = bool(request[0] & self._knows_crc)
        self._size = int.from_bytes(request[4:8], "little") if request[0] & 0x02 else None
        self._data = bytearray()
        self._acknowledged = 0
        self._ending = False
        device.begin_download(*self._object, self._size)
        if self._size is not None and self._size > _MOST_BYTES:
            raise Refusal(Abort.OUT_OF_MEMORY)

    @property
    def _object(self) -> tuple[int, int]:
        return int.from_bytes(self.multiplexer[:2], "little"), self.multiplexer[2]

    def first(self) -> bytes:
        """The initiate response: segments per sub-block, and CRC support."""
        return bytes([0xA0 | self._knows_crc]) + self.multiplexer + bytes([self._block_size, 0, 0, 0])

    def takes(self, request: bytes) -> bool:
        """True for every request up to the last segment, and for the end request."""
        return not self._ending or request[0] & 0xE3 == 0xC1

    def handle(self, request: bytes) -> list[bytes]:
        """Take a segment, or the end with its CRC."""
        return [self._end(request)] if self._ending else self._segment(request)

    def _segment(self, request: bytes) -> list[bytes]:
        """Take a segment; after a gap request retransmission from the lost segment on."""
        number, last = request[0] & 0x7F, bool(request[0] & _LAST)
        if number == self._acknowledged + 1:
            self._acknowledged = number
            self._data += request[1:8]
            self._ending = last
            if len(self._data) > _MOST_BYTES + _SEGMENT_BYTES:
                raise Refusal(Abort.OUT_OF_MEMORY)
        if not last and number < self._block_size:
            return []
        answer = bytes([0xA2, self._acknowledged, self._block_size]) + bytes(5)
        self._acknowledged = 0
        return [answer]

    def _end(self, request: bytes) -> bytes:
        unused = request[0] >> 2 & 0x07
        data = bytes(self._data[: len(self._data) - unused])
        if self._size is not None and len(data) != self._size:
            raise Refusal(Abort.TOO_LONG if len(data) > self._size else Abort.TOO_SHORT)
        if self._crc and crc_hqx(data, 0) != int.from_bytes(request[1:3], "little"):
            raise Refusal(Abort.CRC)
        self._device.download(*self._object, data)
        self.finished = True
        return b"\xa1" + bytes(7)


class ServedBlockUpload:
    """A block upload of *data* initiated by *request*. Raises Refusal unless its block size is 1..127."""

    def __init__(self, request: bytes, data: bytes, *, has_crc: bool = True) -> None:
        self.multiplexer = request[1:4]
        self.finished = False
        self._data = data
        self._has_crc = has_crc
        self._block_size = _checked(request[4])
        #: how many bytes the client has acknowledged, and how many segments it was sent since
        self._acknowledged = 0
        self._sent = 0
        self._ending = False

    def first(self) -> bytes:
        """The initiate response, with the size in bytes."""
        return bytes([0xC2 | (_CRC if self._has_crc else 0)]) + self.multiplexer + len(self._data).to_bytes(4, "little")

    def takes(self, request: bytes) -> bool:
        """True for start, acknowledgement and end."""
        return request[0] >> 5 == _BLOCK_UPLOAD and request[0] & 0x03 != 0

    def handle(self, request: bytes) -> list[bytes]:
        """Send a sub-block at the start and after each acknowledgement, and the end after the last."""
        step = request[0] & 0x03
        if step == 1 and self._ending:
            self.finished = True
            return []
        if step == 3 and not self._sent:
            return self._segments()
        if step == 2 and self._sent and not self._ending:
            return self._next(request[1], request[2])
        raise Refusal(Abort.COMMAND_SPECIFIER)

    def _next(self, acknowledged: int, block_size: int) -> list[bytes]:
        if acknowledged > self._sent:
            raise Refusal(Abort.SEQUENCE)
        self._block_size = _checked(block_size)
        complete = acknowledged == self._sent and self._is_last(self._acknowledged, self._sent)
        self._acknowledged += acknowledged * _SEGMENT_BYTES
        if not complete:
            return self._segments()
        self._ending = True
        unused = (-len(self._data) % _SEGMENT_BYTES) if self._data else _SEGMENT_BYTES
        crc = crc_hqx(self._data, 0) if self._has_crc else 0  # even if not requested: clients check it all the same
        return [bytes([0xC1 | unused << 2]) + crc.to_bytes(2, "little") + bytes(5)]

    def _segments(self) -> list[bytes]:
        """The sub-block after the acknowledged segments."""
        found = []
        for number in range(1, self._block_size + 1):
            start = self._acknowledged + (number - 1) * _SEGMENT_BYTES
            last = self._is_last(self._acknowledged, number)
            part = self._data[start : start + _SEGMENT_BYTES].ljust(_SEGMENT_BYTES, b"\0")
            found.append(bytes([number | (_LAST if last else 0)]) + part)
            if last:
                break
        self._sent = len(found)
        return found

    def _is_last(self, start: int, segments: int) -> bool:
        """True if *segments* segments from byte *start* on reach the end of the data."""
        return start + segments * _SEGMENT_BYTES >= len(self._data)


def _checked(block_size: int) -> int:
    if not 1 <= block_size <= _MOST_SEGMENTS:
        raise Refusal(Abort.BLOCK_SIZE)
    return block_size
