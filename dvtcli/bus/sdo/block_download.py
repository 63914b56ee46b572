"""SDO block download: up to 127 segments go before the server acknowledges them (CiA 301, 7.2.4.3.9 to 7.2.4.3.11).

An acknowledgement names neither object nor sub-block: what came before the last segment of a sub-block is none of it.
Where the server checks no CRC, nothing tells wrong data from right once something was out of order: then the transfer
is aborted, for whoever began it to send the data in segments. Does not know buses, nor what an object means.
"""

from __future__ import annotations

from binascii import crc_hqx

from dvtcli.bus.sdo.dialogue import Dialogue
from dvtcli.bus.sdo.in_blocks import LAST, MOST_SEGMENTS, SEGMENT_BYTES, SIZE_GIVEN, BlockTransfer
from dvtcli.domain.abort import Abort

_INITIATE, _END = 0xC0, 0xC1
_ACKNOWLEDGED, _ENDED = 0xA2, 0xA1
#: how often nothing of a sub-block may have arrived, one time after the other
_PATIENCE = 3


class BlockDownload(BlockTransfer):
    """*data*, which is not empty, on its way by *talk*."""

    def __init__(self, talk: Dialogue, data: bytes) -> None:
        super().__init__(talk)
        self._data = data
        self._segments = -(-len(data) // SEGMENT_BYTES)
        self._block_size = MOST_SEGMENTS

    def run(self, index: int, sub_index: int) -> bool:
        """Write the object; False where it was aborted since nobody could tell whether the data is right.

        SdoAborted where the device refuses, before its data or after it; NoAnswer, SdoProtocolError.
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
        """Send *count* segments from number *first* (0..) on; how many of them arrived."""
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
        """The answer of this *kind*; NoAnswer."""
        while (answer := self._talk.next_frame()) is not None:
            if answer[0] == kind:
                return answer
            self._in_order = False
            self._talk.drop(answer)
        raise self._talk.silent()
