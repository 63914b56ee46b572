"""SDO block upload: up to 127 segments come before they are acknowledged (CiA 301, 7.2.4.3.12 to 7.2.4.3.14).

A segment names neither object nor sub-block: after one out of order a sub-block is acknowledged only once the server is
quiet. Where it sends no CRC, nothing tells wrong data from right then: the transfer is aborted, for whoever began it to
read the object in segments. Does not know buses, nor what an object means.
"""

from __future__ import annotations

from binascii import crc_hqx

from dvtcli.bus.sdo.dialogue import Dialogue
from dvtcli.bus.sdo.in_blocks import LAST, MOST_SEGMENTS, SEGMENT_BYTES, SIZE_GIVEN, BlockTransfer
from dvtcli.domain.abort import Abort

_INITIATE, _START, _ACKNOWLEDGE, _END = 0xA0, 0xA3, 0xA2, 0xA1
_IN_SEGMENTS = 2
#: how long the server is silent when a sub-block in which something was out of order is over (s)
_QUIET_S = 0.2


class BlockUpload(BlockTransfer):
    """An object on its way here by *talk*, of *most_bytes* at most."""

    def __init__(self, talk: Dialogue, most_bytes: int) -> None:
        super().__init__(talk)
        self._most_bytes = most_bytes
        self._data = bytearray()
        self._size: int | None = None
        #: the frame that was taken last
        self._latest = b""

    def run(self, index: int, sub_index: int) -> bytes | None:
        """Read the object; None where the server sends no blocks, or nobody could tell whether the data is right.

        SdoAborted where the device refuses; NoAnswer, SdoProtocolError.
        """
        with self._talk.told(in_blocks=True):
            answer = self._initiate(_INITIATE, index, sub_index, bytes([MOST_SEGMENTS, 0, 0, 0]))
            if answer[0] >> 5 == _IN_SEGMENTS:
                self._talk.abort()
                return None
            self._size = int.from_bytes(answer[4:], "little") if answer[0] & SIZE_GIVEN else None
            if self._size is not None and self._size > self._most_bytes:
                text = f"announces {self._size} bytes, more than any object has"
                raise self._talk.broken(text, Abort.OUT_OF_MEMORY)
            return self._all()

    def _all(self) -> bytes | None:
        request, last = bytes([_START]) + bytes(7), False
        while not last:
            self._talk.send(request)
            taken, last = self._sub_block()
            if self._may_be_wrong():
                return None
            request = bytes([_ACKNOWLEDGE, taken, MOST_SEGMENTS]) + bytes(5)
        self._talk.send(request)
        return self._end()

    def _sub_block(self) -> tuple[int, bool]:
        """Take the segments that come; how many were in order, and whether the last one of all is among them."""
        taken, in_order = 0, True
        while (frame := self._talk.next_frame(None if in_order else _QUIET_S)) is not None:
            number, last = frame[0] & ~LAST, bool(frame[0] & LAST)
            if number != taken + 1:
                self._in_order = in_order = False
                continue
            taken = number
            self._take(frame)
            if last:
                return taken, True
            if in_order and number == MOST_SEGMENTS:
                return taken, False
        if not taken:
            raise self._talk.silent()
        self._in_order = False
        return taken, False

    def _take(self, frame: bytes) -> None:
        self._latest = frame
        self._data += frame[1:]
        most = self._most_bytes if self._size is None else self._size
        if len(self._data) >= most + SEGMENT_BYTES:
            raise self._talk.broken(f"sends more than {most} bytes", Abort.TOO_LONG)

    def _end(self) -> bytes:
        """Compare what came with what the server says at the end, and tell it that all is well."""
        while (frame := self._talk.next_frame()) is not None and (frame == self._latest or frame[0] & 0xE3 != 0xC1):
            self._talk.drop(frame)
        if frame is None:
            raise self._talk.silent()
        data = bytes(self._data[: len(self._data) - (frame[0] >> 2 & 0x07)])
        if self._size is not None and len(data) != self._size:
            code = Abort.TOO_LONG if len(data) > self._size else Abort.TOO_SHORT
            raise self._talk.broken(f"sends {len(data)} of the {self._size} bytes it announced", code)
        if self._has_crc and crc_hqx(data, 0) != int.from_bytes(frame[1:3], "little"):
            raise self._talk.broken("sends data that its CRC does not fit", Abort.CRC)
        self._talk.send(bytes([_END]) + bytes(7))
        return data
