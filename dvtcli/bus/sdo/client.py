"""A strict SDO client for one node: expedited, segmented, and block transfers if worthwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable
from struct import Struct
from typing import TypeVar

from dvtcli.bus.sdo.dialogue import Dialogue
from dvtcli.bus.sdo.sdo_link import DroppedAnswers
from dvtcli.domain.abort import Abort
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, SdoProtocolError

#: consumer heartbeat times (CiA 301, 7.5.2.17)
_HEARTBEAT_CONSUMERS = 0x1016

T = TypeVar("T")


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
        link = self._client.link
        link.begin_transfer(self._turn)
        try:
            data = self._run(lambda: self._client.upload(index, sub_index), timeout_s, retries)
            self._note(index, sub_index, data)
            return data
        finally:
            link.end_transfer(self._turn)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        """Write an object; a request is never repeated, since the device may have accepted it.

        *timeout_s* for each answer overrides the bus's (a store takes seconds). Raises SdoAborted; and NoAnswer,
        SdoProtocolError, BusUnavailable with the state "unknown" once the request was sent.
        """
        link, node_id = self._client.link, self._client.node_id
        link.begin_transfer(self._turn)
        try:
            link.note_act(f"SDO download to 0x{index:04X}:{sub_index:02X} of node {node_id}")
            self._run(lambda: self._client.download(index, sub_index, data), timeout_s, 0)
        except (NoAnswer, SdoProtocolError, BusUnavailable) as error:
            if self._client.requested:
                error.state = "unknown"
            raise
        else:
            self._note(index, sub_index, data)
        finally:
            link.end_transfer(self._turn)

    def _note(self, index: int, sub_index: int, data: bytes) -> None:
        """Inform the bus about a heartbeat consumer: a late heartbeat stops its machine."""
        if index == _HEARTBEAT_CONSUMERS and sub_index:
            self._client.link.consumes_heartbeat(self._client.node_id, sub_index, consumes=any(data))

    def _run(self, transfer: Callable[[], T], timeout_s: float | None, retries: int | None) -> T:
        client = self._client
        client.timeout_s = client.settings.timeout_s if timeout_s is None else timeout_s
        client.retries = client.settings.retries if retries is None else retries
        return transfer()


#: command specifier, index and sub-index
_INITIATE = Struct("<BHB")
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
        in_blocks = self.takes_blocks and self.link.takes_bursts()
        while True:
            answer = self.request_response(_INITIATE.pack(0x40, index, sub_index) + bytes(4))
            if answer[0] & _EXPEDITED:
                unused = answer[0] >> 2 & 3 if answer[0] & _SIZE_GIVEN else 0
                return answer[4 : 8 - unused]
            announced = int.from_bytes(answer[4:], "little") if answer[0] & _SIZE_GIVEN else None
            if in_blocks and announced is not None and MOST_BYTES >= announced >= _BLOCKS_FROM:
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
        from dvtcli.bus.sdo.block_download import BlockUpload

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
            from dvtcli.bus.sdo.block_download import BlockDownload

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
