"""What SDO block upload and download have in common: how they begin, and whether wrong data would be noticed."""

from __future__ import annotations

from dvtcli.bus.sdo.dialogue import Dialogue
from dvtcli.domain.abort import Abort

#: bits of the first byte: the size is given, a CRC is known, the last segment of all
SIZE_GIVEN, CRC, LAST = 0x02, 0x04, 0x80
SEGMENT_BYTES, MOST_SEGMENTS = 7, 127


class BlockTransfer:
    """An object on its way by *talk*."""

    def __init__(self, talk: Dialogue) -> None:
        self._talk = talk
        self._has_crc = False
        #: whether nothing was out of order so far: without a CRC nothing else tells wrong data from right
        self._in_order = True

    def _initiate(self, specifier: int, index: int, sub_index: int, rest: bytes) -> bytes:
        """Begin the transfer, with *rest* behind the object's address; the server's answer."""
        place = index.to_bytes(2, "little") + bytes([sub_index])
        answer = self._talk.request_response(bytes([specifier | CRC]) + place + rest)
        self._has_crc = bool(answer[0] & CRC)
        return answer

    def _may_be_wrong(self) -> bool:
        """Whether nobody can tell if the data is right; the transfer is aborted then."""
        if self._has_crc or self._in_order:
            return False
        self._talk.give_up(Abort.SEQUENCE)
        return True
