"""SDO server: requests of eight bytes in, responses of eight bytes out (CiA 301, 7.2.4).

Expedited and segmented transfers, and the start of a block transfer (`block_transfer`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice

if TYPE_CHECKING:
    from dvtcli.simulator.device.block_transfer import ServedBlockTransfer

DOWNLOAD_SEGMENT, INITIATE_DOWNLOAD, INITIATE_UPLOAD, UPLOAD_SEGMENT, ABORT, BLOCK_UPLOAD, BLOCK_DOWNLOAD = range(7)
#: states in which no SDO is answered
SILENT = (NmtState.INITIALISING, NmtState.STOPPED)
_TOGGLE, _ABORT_BYTE = 0x10, 0x80
_MOST_BYTES = 1 << 20
_OUT_OF_MEMORY = 0x0504_0005


@dataclass(slots=True)
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
        if self._block is not None and self.in_block(request):
            return self._go_on(self._block, request)
        self._block = None
        specifier = request[0] >> 5
        if specifier == ABORT:
            self.reset()
            return None
        service = self._services.get(specifier)
        if specifier in (BLOCK_UPLOAD, BLOCK_DOWNLOAD) and not self.device.family.block_size:
            service = None
        place = self._transfer.multiplexer if self._transfer and specifier in (0, 3) else request[1:4]
        try:
            if service is None:
                raise Refusal(Abort.COMMAND_SPECIFIER)
            return service(request)
        except Refusal as refusal:
            self._transfer = None
            return b"\x80" + place + refusal.code.to_bytes(4, "little")

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
        return self._block is not None and request[0] != _ABORT_BYTE and self._block.takes(request)

    def give_up(self) -> bytes | None:
        """Abort a block transfer whose client is gone; None without a transfer."""
        if self._block is None:
            return None
        multiplexer = self._block.multiplexer
        self.reset()
        return b"\x80" + multiplexer + Abort.TIME_OUT.to_bytes(4, "little")

    def _go_on(self, block: ServedBlockTransfer, request: bytes) -> bytes | None:
        """Pass *request* to *block*."""
        try:
            responses = block.handle(request)
        except Refusal as refusal:
            self._block = None
            return b"\x80" + block.multiplexer + refusal.code.to_bytes(4, "little")
        if block.finished:
            self._block = None
        self.more = responses[1:]
        return responses[0] if responses else None

    def _initiate_block_upload(self, request: bytes) -> bytes:
        """Begin a block upload; short data goes without block transfer if the client's switch threshold allows."""
        if request[0] & 0x03:
            raise Refusal(Abort.COMMAND_SPECIFIER)
        from dvtcli.simulator.device.block_transfer import ServedBlockUpload

        data = self.device.upload(*_object(request[1:4]))
        if len(data) <= request[5] and request[5]:
            return self._initiate_upload(request)
        self._transfer = None
        self._block = block = ServedBlockUpload(request, data, has_crc=self.device.family.block_crc)
        return block.first()

    def _initiate_block_download(self, request: bytes) -> bytes:
        from dvtcli.simulator.device.block_transfer import ServedBlockDownload

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
            raise Refusal(_OUT_OF_MEMORY)
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
