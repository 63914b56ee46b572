"""A strict SDO client for one node: expedited, segmented, and block transfers if worthwhile."""

from __future__ import annotations

import threading
from binascii import crc_hqx
from struct import Struct

from dvtcli.bus.sdo.dialogue import Dialogue
from dvtcli.bus.sdo.sdo_link import DroppedAnswers
from dvtcli.domain.abort import Abort
from dvtcli.domain.objects import CONSUMER_HEARTBEAT
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, SdoProtocolError


class SdoChannel:
    """A node's SdoTransport: one transfer at a time, other threads wait."""

    def __init__(self, client: StrictSdoClient) -> None:
        self._client = client
        self._turn = threading.Lock()

    @property
    def dropped(self) -> DroppedAnswers:
        """Discarded answers from this node, and signs of another SDO client."""
        return self._client.dropped

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        """Read an object, exactly as the device sends it, expedited or in segments.

        *timeout_s* for each answer and *retries* override the bus's. Raises SdoAborted, NoAnswer, SdoProtocolError,
        BusUnavailable.
        """
        client = self._client
        client.link.begin_transfer(self._turn)
        try:
            self._limit(timeout_s, retries)
            data = client.upload(index, sub_index)
            if index == CONSUMER_HEARTBEAT:
                self._note_consumer(sub_index, data)
            return data
        finally:
            client.link.end_transfer(self._turn)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object; a request is never repeated, since the device may have accepted it.

        *timeout_s* for each answer overrides the bus's (a store takes seconds). Raises SdoAborted; and NoAnswer,
        SdoProtocolError, BusUnavailable with the state "unknown" once the request was sent.
        """
        link, node_id = self._client.link, self._client.node_id
        link.begin_transfer(self._turn)
        try:
            link.note_act(f"SDO download to 0x{index:04X}:{sub_index:02X} of node {node_id}")
            self._limit(timeout_s, 0)
            self._client.download(index, sub_index, data)
        except (NoAnswer, SdoProtocolError, BusUnavailable) as error:
            if self._client.requested:
                error.state = "unknown"
            raise
        else:
            if index == CONSUMER_HEARTBEAT:
                self._note_consumer(sub_index, data)
        finally:
            link.end_transfer(self._turn)

    def _note_consumer(self, sub_index: int, data: bytes) -> None:
        """Inform the bus about a heartbeat consumer: a late heartbeat stops its machine."""
        if sub_index:
            self._client.link.consumes_heartbeat(self._client.node_id, sub_index, consumes=any(data))

    def _limit(self, timeout_s: float | None, retries: int | None) -> None:
        """Limit the next transfer; None stands for the bus's limits."""
        client = self._client
        client.timeout_s = client.settings.timeout_s if timeout_s is None else timeout_s
        client.retries = client.settings.retries if retries is None else retries


#: command specifier, index and sub-index; the same with four bytes of 0
_INITIATE, _INITIATE_EMPTY = Struct("<BHB"), Struct("<BHB4x")
_TOGGLE, _EXPEDITED, _SIZE_GIVEN, _LAST = 0x10, 0x02, 0x01, 0x01
#: No object of a CANopen device is larger; a longer transfer would never end.
MOST_BYTES = 1 << 20
#: minimum length for block transfers (bytes): shorter data gain hardly any time
_BLOCKS_FROM = 128
#: first byte of abort codes about the protocol, not about the object
_ABOUT_THE_TRANSFER = 0x05


class StrictSdoClient(Dialogue):
    """Uploads and downloads; raises only errors of dvtcli."""

    #: False once the server refused block transfers
    takes_blocks = True

    def upload(self, index: int, sub_index: int) -> bytes:
        """Read an object, by blocks from 128 announced bytes on. Raises SdoProtocolError if the data length differs.

        If the block upload fails, segments are used.

        Reading has no side effects, so a transfer with faulty segments is repeated up to `retries` times.
        """
        left = self.retries
        in_blocks = self.takes_blocks
        while True:
            answer = self.request_response(_INITIATE_EMPTY.pack(0x40, index, sub_index))
            first = answer[0]
            if first & _EXPEDITED:
                unused = first >> 2 & 3 if first & _SIZE_GIVEN else 0
                return answer[4 : 8 - unused]
            announced = int.from_bytes(answer[4:], "little") if first & _SIZE_GIVEN else None
            is_long = announced is not None and MOST_BYTES >= announced >= _BLOCKS_FROM
            if in_blocks and is_long and self.link.takes_bursts():
                in_blocks = False
                self.abort()
                if (data := self._upload_blocks(index, sub_index)) is not None:
                    return data
                continue
            try:
                with self.told():
                    return self._upload_segments(announced)
            except (NoAnswer, SdoProtocolError):
                if not left:
                    raise
                left -= 1
                self.repeated += 1

    def _upload_blocks(self, index: int, sub_index: int) -> bytes | None:
        """Read an object by a block upload; None if it fails and segments may work."""
        try:
            return BlockUpload(self, MOST_BYTES).run(index, sub_index)
        except SdoAborted as refused:
            self._no_blocks_after(refused)
        except (NoAnswer, SdoProtocolError):
            self.repeated += 1
        return None

    def _no_blocks_after(self, refused: SdoAborted) -> None:
        """Raise *refused* unless the transfer type is its cause: then segments are tried, later without delay."""
        if refused.code >> 24 != _ABOUT_THE_TRANSFER or refused.code == Abort.OUT_OF_MEMORY:
            raise refused
        if refused.code == Abort.COMMAND_SPECIFIER:
            self.takes_blocks = False

    def _upload_segments(self, announced: int | None) -> bytes:
        if announced is not None and announced > MOST_BYTES:
            raise self.broken(f"announces {announced} bytes, more than any object has", Abort.OUT_OF_MEMORY)
        data = bytearray()
        toggle, last = 0, False
        while not last:
            answer = self.request_response(bytes([0x60 | toggle]) + bytes(7))
            part = answer[1 : 8 - (answer[0] >> 1 & 7)]
            last = bool(answer[0] & _LAST)
            toggle ^= _TOGGLE
            data += part
            if announced is not None and len(data) > announced:
                raise self.broken(f"sends more than the {announced} bytes it announced", Abort.TOO_LONG)
            if len(data) > MOST_BYTES:
                raise self.broken(f"sends more than {MOST_BYTES} bytes", Abort.OUT_OF_MEMORY)
            if not part and not last:  # the transfer would never end
                raise self.broken("sends an empty segment in the middle", Abort.GENERAL)
        if announced is not None and len(data) < announced:
            raise self.broken(f"sends {len(data)} of the {announced} bytes it announced", Abort.TOO_SHORT)
        return bytes(data)

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        """Write an object: expedited for 1 to 4 bytes, by blocks from 128 on, otherwise in segments.

        If the device refuses blocks for protocol reasons, segments are used.
        """
        size = len(data)
        if 1 <= size <= 4:
            header = _INITIATE.pack(0x23 | (4 - size) << 2, index, sub_index)
            self.request_response(header + data.ljust(4, b"\0"))
            return
        if size >= _BLOCKS_FROM and self.takes_blocks and self.link.takes_bursts():
            try:
                if BlockDownload(self, data).run(index, sub_index):
                    return
            except SdoAborted as refused:
                self._no_blocks_after(refused)
        with self.told():
            self._download_segments(index, sub_index, data)

    def _download_segments(self, index: int, sub_index: int, data: bytes) -> None:
        size = len(data)
        self.request_response(_INITIATE.pack(0x21, index, sub_index) + size.to_bytes(4, "little"))
        toggle = 0
        for start in range(0, max(size, 1), 7):
            part = data[start : start + 7]
            last = start + 7 >= size
            self.request_response(bytes([toggle | (7 - len(part)) << 1 | last]) + part.ljust(7, b"\0"))
            toggle ^= _TOGGLE


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
            raise self._talk.broken("sends data with a wrong CRC", Abort.CRC)
        self._talk.send(bytes([_UPLOAD_END]) + bytes(7))
        return data


#: bits of the first byte: size indicated, CRC supported, last segment of the object
SIZE_GIVEN, CRC, LAST = 0x02, 0x04, 0x80
SEGMENT_BYTES, MOST_SEGMENTS = 7, 127
_INITIATE_BLOCK, _END = 0xC0, 0xC1
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
            answer = self._initiate(_INITIATE_BLOCK | SIZE_GIVEN, index, sub_index, size)
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
                raise self._talk.broken("accepts none of the segments", Abort.TIME_OUT)
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
