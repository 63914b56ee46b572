"""Inject one-time faults between the SDO server of a simulated node and the network.

The caller waits and passes the time in.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from dvtcli.domain.objects import STORE_PARAMETERS
from dvtcli.domain.pdo import Pdo
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.sdo_server import (
    BLOCK_DOWNLOAD,
    BLOCK_UPLOAD,
    INITIATE_DOWNLOAD,
    INITIATE_UPLOAD,
    UPLOAD_SEGMENT,
    SdoServer,
)
from dvtcli.simulator.device.simulated_faults import Fault, FaultKind
from dvtcli.simulator.device.strict_device import StrictDevice


def break_device(device: StrictDevice, fault: Fault) -> None:
    """Give *device* the lasting *fault*. Raises ValueError if *device* lacks the part."""
    if fault.kind.of_bit_rate:
        _mistime(device, fault)
    elif fault.kind is FaultKind.IGNORES_NMT:
        device.ignores_nmt = True
    elif fault.kind.of_flash:
        _break_flash(device, fault.kind)
    else:
        _break_memory(device, fault.kind)


def _mistime(device: StrictDevice, fault: Fault) -> None:
    """Apply a bit rate fault to the device."""
    lss = device.lss
    match fault.kind:
        case FaultKind.BIT_RATE:
            lss.run_at(fault.code, lss.known_rates)
        case FaultKind.NO_BIT_TIMING:
            lss.known_rates = ()
        case FaultKind.KEEPS_BIT_RATE:
            lss.keeps_rate = True
        case FaultKind.LOSES_BIT_RATE:
            lss.loses_rate = True


def _break_memory(device: StrictDevice, kind: FaultKind) -> None:
    store = device.areas
    match kind:
        case FaultKind.STORE_FAILS:
            store.fails = True
        case FaultKind.STORES_NOTHING:
            store.stores_nothing = True
        case FaultKind.SAVES_ITSELF:
            store.saves_itself = True
        case FaultKind.KEEPS_RAM:
            store.keeps_ram = True
        case FaultKind.RESTORES_NOTHING:
            store.restores_nothing = True


def _break_flash(device: StrictDevice, kind: FaultKind) -> None:
    loader = device.loader
    if loader is None:
        raise ValueError(f"{kind}: the node has no boot loader: no program can be downloaded")
    loader.fails, loader.alters = kind is FaultKind.FLASH_FAILS, kind is FaultKind.FLASH_ALTERS


_TOGGLE, _EXPEDITED = 0x10, 0x02
#: kinds whose download does not reach the device
_NEVER_TAKEN = (FaultKind.LOSE_REQUEST, FaultKind.RESET, FaultKind.SILENT, FaultKind.BUS_ERROR)


@dataclass(frozen=True, slots=True)
class FaultyReply:
    """The server's response to a request: *frames* in order, *delay_s* seconds later."""

    frames: tuple[bytes, ...] = ()
    delay_s: float = 0.0


class FaultyServer:
    """*server* with *faults*. Raises ValueError if two of them happen at the same download.

    *dead*: the node is off for good; *bus_failed*: the bus is. A resetting node is INITIALISING until *boots_at_s*,
    when the caller of `handle` boots the node.
    """

    def __init__(self, server: SdoServer, faults: Iterable[Fault]) -> None:
        self._server = server
        self._due: dict[int, Fault] = {}
        self._due_at_read: dict[int, Fault] = {}
        self._enable_alters: Fault | None = None
        self._no_boot_up = False
        #: uploads since the last download; None before the first one
        self._reads: int | None = None
        #: values restored by the node itself, each with its time
        self._corrections: list[tuple[float, int, int, bytes]] = []
        self._store_delay_s = 0.0
        self._wrong_toggle = False
        #: the data of an upload segmented on purpose
        self._segmented: bytes | None = None
        self.downloads = 0
        self.dead = False
        self.bus_failed = False
        self.boots_at_s: float | None = None
        for fault in faults:
            self._add(fault)

    def _add(self, fault: Fault) -> None:
        if fault.at is not None:
            due = self._due_at_read if fault.kind.at_read else self._due
            if fault.at in due:
                raise ValueError(f"{due[fault.at]} and {fault} happen at the same {_moment(fault)}")
            due[fault.at] = fault
        elif fault.kind is FaultKind.ENABLE_ALTERS:
            self._enable_alters = fault
        elif fault.kind is FaultKind.NO_BOOT_UP:
            self._no_boot_up = True
        elif fault.kind is FaultKind.SLOW_STORE:
            self._store_delay_s = fault.seconds or 0.0
        else:
            break_device(self._server.device, fault)

    def handle(self, request: bytes, now_s: float) -> FaultyReply:
        """The answer to *request* at *now_s*, including faults."""
        if len(request) != 8 or self._server.in_block(request):
            return self._plain(request)
        if request[0] >> 5 in (INITIATE_UPLOAD, BLOCK_UPLOAD) and self._reads is not None:
            self._reads += 1
            fault = self._due_at_read.pop(self._reads, None)
            return self._plain(request) if fault is None else self._acted_at_read(fault, request, now_s)
        if request[0] >> 5 in (INITIATE_DOWNLOAD, BLOCK_DOWNLOAD):
            self.downloads += 1
            self._reads = 0
            fault = self._due.pop(self.downloads, None)
            answer = self._plain(request) if fault is None else self._acted(fault, request, now_s)
            if int.from_bytes(request[1:3], "little") == STORE_PARAMETERS:
                return FaultyReply(answer.frames, answer.delay_s + self._store_delay_s)
            return answer
        return self._plain(request)

    def _acted_at_read(self, fault: Fault, request: bytes, now_s: float) -> FaultyReply:
        if fault.kind is FaultKind.REFUSE_READ:
            return _refusal(fault, request)
        answer = self._plain(request) if fault.kind is FaultKind.RESET_AFTER_READ else FaultyReply()
        self._reset(now_s + (fault.seconds or 0.0))
        return answer

    @property
    def due_s(self) -> float | None:
        """The time of the next `poll`, None for never."""
        times = [due for due, *_ in self._corrections]
        return min([*times, *([] if self.boots_at_s is None else [self.boots_at_s])], default=None)

    def poll(self, now_s: float) -> None:
        """Boot a node after its reset at *now_s*, and apply its own corrections."""
        device = self._server.device
        if self.boots_at_s is not None and self.boots_at_s <= now_s:
            self.boots_at_s = None
            device.boot_up()
            if self._no_boot_up:
                device.outbox.pop()
        due = [correction for correction in self._corrections if correction[0] <= now_s]
        self._corrections = [correction for correction in self._corrections if correction[0] > now_s]
        for _, index, sub_index, data in due:
            device.set_value(index, sub_index, data)

    def _alter(self, fault: Fault) -> None:
        """Change the object of *fault*, as the device's application would."""
        if fault.place is not None:
            self._server.device.set_value(*fault.place, altered(self._server.device, fault))

    def _taken(self, request: bytes, frames: tuple[bytes, ...]) -> None:
        """Apply the node's own actions after an accepted download."""
        if self._enable_alters is not None and frames and frames[0][0] != 0x80 and _enables(request):
            self._alter(self._enable_alters)

    def _acted(self, fault: Fault, request: bytes, now_s: float) -> FaultyReply:
        if fault.kind is FaultKind.REFUSE:
            return _refusal(fault, request)
        if fault.kind in _NEVER_TAKEN:
            self._lose(fault, now_s)
            return FaultyReply()
        self._wrong_toggle = fault.kind is FaultKind.TOGGLE
        index, sub_index = int.from_bytes(request[1:3], "little"), request[3]
        held = self._server.device.value(index, sub_index) if fault.kind is FaultKind.CORRECTS else b""
        frames = self._plain(request).frames
        match fault.kind:
            case FaultKind.ALTERS:
                self._alter(fault)
            case FaultKind.CORRECTS:
                self._corrections.append((now_s + (fault.seconds or 0.0), index, sub_index, held))
            case FaultKind.LOSE_RESPONSE:
                return FaultyReply()
            case FaultKind.LATE:
                return FaultyReply(frames, fault.seconds or 0.0)
            case FaultKind.DUPLICATE:
                return FaultyReply(frames * 2)
            case FaultKind.FOREIGN:
                return FaultyReply((_for_another_object(request), *frames))
            case FaultKind.MALFORMED:
                return FaultyReply(tuple(frame[:3] for frame in frames))
        return FaultyReply(frames)

    def _lose(self, fault: Fault, now_s: float) -> None:
        """Drop the request, with the further effects of most kinds."""
        self.dead = fault.kind is FaultKind.SILENT
        self.bus_failed = fault.kind is FaultKind.BUS_ERROR
        if fault.kind is FaultKind.RESET:
            self._reset(now_s + (fault.seconds or 0.0))

    def _reset(self, boots_at_s: float) -> None:
        self._server.device.restart()
        self._server.reset()
        self._segmented = None
        self._corrections.clear()
        self.boots_at_s = boots_at_s

    def _plain(self, request: bytes) -> FaultyReply:
        """The server's own answer, with a wrong toggle bit in the first segment after the fault is due."""
        specifier = request[0] >> 5 if len(request) == 8 else None
        if specifier == UPLOAD_SEGMENT and self._segmented is not None:
            data, self._segmented = self._segmented, None
            head = (request[0] & _TOGGLE ^ _TOGGLE) | (7 - len(data)) << 1 | 1
            return FaultyReply((bytes([head]) + data.ljust(7, b"\0"),))
        self._segmented = None
        response = self._server.handle(request)
        if response is None:
            return FaultyReply()
        if self._wrong_toggle and response[0] != 0x80:
            response = self._with_wrong_toggle(specifier, response)
        if specifier == INITIATE_DOWNLOAD:
            self._taken(request, (response,))
        return FaultyReply((response, *self._server.take_more()))

    def _with_wrong_toggle(self, specifier: int | None, response: bytes) -> bytes:
        """*response* with a wrong toggle bit; an expedited upload becomes segmented first, as servers may do."""
        if specifier == INITIATE_UPLOAD and response[0] & _EXPEDITED:
            self._wrong_toggle = False
            self._segmented = response[4 : 8 - (response[0] >> 2 & 3)]
            return b"\x41" + response[1:4] + len(self._segmented).to_bytes(4, "little")
        if specifier in (INITIATE_UPLOAD, INITIATE_DOWNLOAD):
            return response
        self._wrong_toggle = False
        return bytes([response[0] ^ _TOGGLE]) + response[1:]


def altered(device: StrictDevice, fault: Fault) -> bytes:
    """The object's new value under *fault*. Raises ValueError if *device* lacks the object or it is too small."""
    index, sub_index = fault.place or (0, 0)
    try:
        device.value(index, sub_index)
    except Refusal as refusal:
        raise ValueError(f"{fault}: the node has no object {index:04X}:{sub_index:02X}") from refusal
    size, value = device.size_of(index, sub_index) or 4, fault.value or 0
    if value >= 1 << 8 * size:
        raise ValueError(f"{fault}: {index:04X}:{sub_index:02X} has {size} byte{'s' if size > 1 else ''} only")
    return value.to_bytes(size, "little")


def _refusal(fault: Fault, request: bytes) -> FaultyReply:
    return FaultyReply((b"\x80" + request[1:4] + (fault.code or 0).to_bytes(4, "little"),))


def _moment(fault: Fault) -> str:
    return "upload" if fault.kind.at_read else "download"


def _enables(request: bytes) -> bool:
    """True if a download makes a PDO valid: its COB-ID, expedited, with bit 31 clear."""
    pdo = Pdo.at(int.from_bytes(request[1:3], "little"))
    return (
        pdo is not None
        and pdo.communication_index == int.from_bytes(request[1:3], "little")
        and (request[3] == 1 and not request[7] & 0x80)
    )


def _for_another_object(request: bytes) -> bytes:
    """The acknowledgement of a download to a neighbouring object, accepted by a lenient client."""
    return b"\x60" + request[1:3] + bytes([request[3] ^ 0x40]) + bytes(4)
