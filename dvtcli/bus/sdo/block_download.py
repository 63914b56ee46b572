"""SDO block download: up to 127 segments before the server acknowledges (CiA 301, 7.2.4.3.9 to 7.2.4.3.11).

An acknowledgement names neither object nor sub-block: if received before a sub-block's last segment, it is discarded.
If the server checks no CRC, wrong data cannot be detected after a disorder: the transfer
is then aborted, and the caller sends the data in segments.
"""

from __future__ import annotations

from binascii import crc_hqx

from dvtcli.bus.sdo.dialogue import Dialogue
from dvtcli.domain.abort import Abort

_UPLOAD_INITIATE, _START, _ACKNOWLEDGE, _UPLOAD_END = 0xA0, 0xA3, 0xA2, 0xA1
_IN_SEGMENTS = 2
#: silence of the server (s) that ends a sub-block with a disorder
_QUIET_S = 0.2


class BlockTransfer:
    """A block transfer of an object over *talk*."""

    def __init__(self, talk: Dialogue) -> None:
        self._talk = talk
        self._has_crc = False
        #: whether all segments were in order so far: without CRC the only sign of correct data
        self._in_order = True

    def _initiate(self, specifier: int, index: int, sub_index: int, rest: bytes) -> bytes:
        """Begin the transfer, with *rest* behind the object's address; the server's answer."""
        place = index.to_bytes(2, "little") + bytes([sub_index])
        answer = self._talk.request_response(bytes([specifier | CRC]) + place + rest)
        self._has_crc = bool(answer[0] & CRC)
        return answer

    def _may_be_wrong(self) -> bool:
        """Whether wrong data is possible and undetectable; the transfer is then aborted."""
        if self._has_crc or self._in_order:
            return False
        self._talk.give_up(Abort.SEQUENCE)
        return True


class BlockUpload(BlockTransfer):
    """Upload of an object over *talk*, of *most_bytes* at most."""

    def __init__(self, talk: Dialogue, most_bytes: int) -> None:
        super().__init__(talk)
        self._most_bytes = most_bytes
        self._data = bytearray()
        self._size: int | None = None
        #: the last accepted frame
        self._latest = b""

    def run(self, index: int, sub_index: int) -> bytes | None:
        """Read the object; None if the server sends no blocks, or if wrong data could not be detected.

        Raises SdoAborted if the device refuses; NoAnswer, SdoProtocolError.
        """
        with self._talk.told(in_blocks=True):
            answer = self._initiate(_UPLOAD_INITIATE, index, sub_index, bytes([MOST_SEGMENTS, 0, 0, 0]))
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
        """Receive segments; the number in order, and whether the last segment of the object is among them."""
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
        """Check the data against the server's final message, and acknowledge it."""
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
        self._talk.send(bytes([_UPLOAD_END]) + bytes(7))
        return data


#: bits of the first byte: size indicated, CRC supported, last segment of the object
SIZE_GIVEN, CRC, LAST = 0x02, 0x04, 0x80
SEGMENT_BYTES, MOST_SEGMENTS = 7, 127


_INITIATE, _END = 0xC0, 0xC1
_ACKNOWLEDGED, _ENDED = 0xA2, 0xA1
#: maximum consecutive sub-blocks without any accepted segment
_PATIENCE = 3


class BlockDownload(BlockTransfer):
    """Download of *data*, which must not be empty, over *talk*."""

    def __init__(self, talk: Dialogue, data: bytes) -> None:
        super().__init__(talk)
        self._data = data
        self._segments = -(-len(data) // SEGMENT_BYTES)
        self._block_size = MOST_SEGMENTS

    def run(self, index: int, sub_index: int) -> bool:
        """Write the object; False if aborted because wrong data could not be detected.

        Raises SdoAborted if the device refuses, before its data or after it; NoAnswer, SdoProtocolError.
        """
        size = len(self._data).to_bytes(4, "little")
        with self._talk.told(in_blocks=True):
            answer = self._initiate(_INITIATE | SIZE_GIVEN, index, sub_index, size)
            self._block_size = self._checked(answer[4])
            if not self._send_all():
                return False
            self._end()
        return True

    def _checked(self, block_size: int) -> int:
        if not 1 <= block_size <= MOST_SEGMENTS:
            raise self._talk.broken(f"asks for sub-blocks of {block_size} segments", Abort.BLOCK_SIZE)
        return block_size

    def _send_all(self) -> bool:
        sent = failures = 0
        while sent < self._segments:
            count = min(self._block_size, self._segments - sent)
            taken = self._sub_block(sent, count)
            if self._may_be_wrong():
                return False
            failures = 0 if taken else failures + 1
            if failures > _PATIENCE:
                raise self._talk.broken("takes none of the segments it is sent", Abort.TIME_OUT)
            sent += taken
        return True

    def _sub_block(self, first: int, count: int) -> int:
        """Send *count* segments from number *first* (0..) on; the number that arrived."""
        for number in range(1, count + 1):
            start = (first + number - 1) * SEGMENT_BYTES
            last = LAST if first + number == self._segments else 0
            if number == count and self._talk.sweep():
                self._in_order = False
            part = self._data[start : start + SEGMENT_BYTES].ljust(SEGMENT_BYTES, b"\0")
            self._talk.send(bytes([number | last]) + part)
        answer = self._await(_ACKNOWLEDGED)
        taken = answer[1]
        if taken > count:
            raise self._talk.broken(f"acknowledges segment {taken} of {count}", Abort.SEQUENCE)
        self._in_order = self._in_order and taken == count
        self._block_size = self._checked(answer[2])
        return taken

    def _end(self) -> None:
        unused = -len(self._data) % SEGMENT_BYTES
        crc = crc_hqx(self._data, 0) if self._has_crc else 0
        self._talk.sweep()
        self._talk.send(bytes([_END | unused << 2]) + crc.to_bytes(2, "little") + bytes(5))
        self._await(_ENDED)

    def _await(self, kind: int) -> bytes:
        """The answer of *kind*. Raises NoAnswer."""
        while (answer := self._talk.next_frame()) is not None:
            if answer[0] == kind:
                return answer
            self._in_order = False
            self._talk.drop(answer)
        raise self._talk.silent()
