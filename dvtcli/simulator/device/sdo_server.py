"""SDO server: requests of eight bytes in, responses of eight bytes out (CiA 301, 7.2.4).

Expedited, segmented and block transfers.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice

DOWNLOAD_SEGMENT, INITIATE_DOWNLOAD, INITIATE_UPLOAD, UPLOAD_SEGMENT, ABORT, BLOCK_UPLOAD, BLOCK_DOWNLOAD = range(7)
#: states in which no SDO is answered
SILENT = (NmtState.INITIALISING, NmtState.STOPPED)
_TOGGLE, _ABORT_BYTE = 0x10, 0x80
_MOST_BYTES = 1 << 20


@dataclass(slots=True, eq=False, repr=False)
class _SegmentedTransfer:
    """A segmented transfer: *multiplexer* is index and sub-index as on the wire, *size* the announced size."""

    multiplexer: bytes
    upload: bool
    data: bytearray = field(default_factory=bytearray)
    size: int | None = None
    toggle: int = 0

    @property
    def object(self) -> tuple[int, int]:
        return _object(self.multiplexer)


class SdoServer:
    """The default SDO server of one device."""

    def __init__(self, device: StrictDevice) -> None:
        self.device = device
        self._transfer: _SegmentedTransfer | None = None
        self._block: ServedBlockTransfer | None = None
        #: the frames after the last response, in order: the other segments of a sub-block
        self.more: list[bytes] = []
        self._services: dict[int, Callable[[bytes], bytes]] = {
            DOWNLOAD_SEGMENT: self._download_segment,
            INITIATE_DOWNLOAD: self._initiate_download,
            INITIATE_UPLOAD: self._initiate_upload,
            UPLOAD_SEGMENT: self._upload_segment,
            BLOCK_UPLOAD: self._initiate_block_upload,
            BLOCK_DOWNLOAD: self._initiate_block_download,
        }

    def handle(self, request: bytes) -> bytes | None:
        """The response to *request*, None for no response (wrong length, client abort, NMT state).

        Further responses are in `more`, emptied by `take_more`.
        """
        if self.device.state in SILENT:
            self.reset()
            return None
        if len(request) != 8:
            return None
        if (block := self._block_of(request)) is not None:
            return self._go_on(block, request)
        self._block = None
        specifier = request[0] >> 5
        if specifier == ABORT:
            self.reset()
            return None
        service = self._services.get(specifier)
        if specifier in (BLOCK_UPLOAD, BLOCK_DOWNLOAD) and not self.device.family.block_size:
            service = None
        is_segment = specifier in (DOWNLOAD_SEGMENT, UPLOAD_SEGMENT)
        multiplexer = self._transfer.multiplexer if self._transfer and is_segment else request[1:4]
        try:
            if service is None:
                raise Refusal(Abort.COMMAND_SPECIFIER)
            return service(request)
        except Refusal as refusal:
            self._transfer = None
            return _abort(multiplexer, refusal.code)

    def reset(self) -> None:
        """Drop a transfer in progress, as a reset does."""
        self._transfer = None
        self._block = None
        self.more.clear()

    def take_more(self) -> list[bytes]:
        """The frames after the last response; empties `more`."""
        more, self.more = self.more, []
        return more

    def in_block(self, request: bytes) -> bool:
        """True if *request* is a frame of the block transfer in progress."""
        return self._block_of(request) is not None

    def _block_of(self, request: bytes) -> ServedBlockTransfer | None:
        """The block transfer in progress, if *request* is a frame of it."""
        block = self._block
        return block if block is not None and request[0] != _ABORT_BYTE and block.takes(request) else None

    def give_up(self) -> bytes | None:
        """Abort a block transfer whose client is gone; None without a transfer."""
        if self._block is None:
            return None
        multiplexer = self._block.multiplexer
        self.reset()
        return _abort(multiplexer, Abort.TIME_OUT)

    def _go_on(self, block: ServedBlockTransfer, request: bytes) -> bytes | None:
        """Pass *request* to *block*."""
        try:
            responses = block.handle(request)
        except Refusal as refusal:
            self._block = None
            return _abort(block.multiplexer, refusal.code)
        if block.finished:
            self._block = None
        self.more = responses[1:]
        return responses[0] if responses else None

    def _initiate_block_upload(self, request: bytes) -> bytes:
        """Begin a block upload; short data goes without block transfer if the client's switch threshold allows."""
        if request[0] & 0x03:
            raise Refusal(Abort.COMMAND_SPECIFIER)
        data = self.device.upload(*_object(request[1:4]))
        if len(data) <= request[5] and request[5]:
            return self._initiate_upload(request)
        self._transfer = None
        self._block = block = ServedBlockUpload(request, data, has_crc=self.device.family.block_crc)
        return block.first()

    def _initiate_block_download(self, request: bytes) -> bytes:
        self._transfer = None
        self._block = block = ServedBlockDownload(self.device, request)
        return block.first()

    def _initiate_upload(self, request: bytes) -> bytes:
        place = request[1:4]
        self._transfer = None
        data = self.device.upload(*_object(place))
        if 1 <= len(data) <= 4:
            return bytes([0x43 | (4 - len(data)) << 2]) + place + data.ljust(4, b"\0")
        self._transfer = _SegmentedTransfer(place, upload=True, data=bytearray(data))
        return b"\x41" + place + len(data).to_bytes(4, "little")

    def _upload_segment(self, request: bytes) -> bytes:
        transfer = self._running(request, upload=True)
        segment = transfer.data[:7]
        del transfer.data[:7]
        last = not transfer.data
        if last:
            self._transfer = None
        head = request[0] & _TOGGLE | (7 - len(segment)) << 1 | int(last)
        return bytes([head]) + bytes(segment).ljust(7, b"\0")

    def _initiate_download(self, request: bytes) -> bytes:
        command, place = request[0], request[1:4]
        self._transfer = None
        where = _object(place)
        size_given = bool(command & 0x01)
        if command & 0x02:
            length = 4 - (command >> 2 & 0x03) if size_given else self._expedited_length(*where)
            self.device.download(*where, request[4 : 4 + length])
        else:
            size = int.from_bytes(request[4:8], "little") if size_given else None
            self.device.begin_download(*where, size)
            self._transfer = _SegmentedTransfer(place, upload=False, size=size)
        return b"\x60" + place + bytes(4)

    def _expedited_length(self, index: int, sub_index: int) -> int:
        """The length of expedited data without size indication: the object's length."""
        return min(self.device.size_of(index, sub_index) or 4, 4)

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._running(request, upload=False)
        transfer.data += request[1 : 8 - (request[0] >> 1 & 0x07)]
        if len(transfer.data) > _MOST_BYTES:
            raise Refusal(Abort.OUT_OF_MEMORY)
        if transfer.size is not None and len(transfer.data) > transfer.size:
            raise Refusal(Abort.TOO_LONG)
        if request[0] & 0x01:
            self._finish_download(transfer)
        return bytes([0x20 | request[0] & _TOGGLE]) + bytes(7)

    def _finish_download(self, transfer: _SegmentedTransfer) -> None:
        if transfer.size is not None and len(transfer.data) < transfer.size:
            raise Refusal(Abort.TOO_SHORT)
        self._transfer = None
        self.device.download(*transfer.object, bytes(transfer.data))

    def _running(self, request: bytes, *, upload: bool) -> _SegmentedTransfer:
        """The transfer of a segment, with its toggle bit checked and flipped."""
        transfer = self._transfer
        if transfer is None or transfer.upload is not upload:
            raise Refusal(Abort.COMMAND_SPECIFIER)
        if request[0] & _TOGGLE != transfer.toggle:
            raise Refusal(Abort.TOGGLE_BIT)
        transfer.toggle ^= _TOGGLE
        return transfer


def _object(multiplexer: bytes) -> tuple[int, int]:
    return int.from_bytes(multiplexer[:2], "little"), multiplexer[2]


def _abort(multiplexer: bytes, code: int) -> bytes:
    """The frame that aborts a transfer of the object *multiplexer* (CiA 301, 7.2.4.3.17)."""
    return bytes([_ABORT_BYTE]) + multiplexer + code.to_bytes(4, "little")


_MOST_SEGMENTS, _SEGMENT_BYTES = 127, 7
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
        device.begin_download(*_object(self.multiplexer), self._size)
        if self._size is not None and self._size > _MOST_BYTES:
            raise Refusal(Abort.OUT_OF_MEMORY)

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
        self._device.download(*_object(self.multiplexer), data)
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
        return request[0] >> 5 == BLOCK_UPLOAD and request[0] & 0x03 != 0

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
