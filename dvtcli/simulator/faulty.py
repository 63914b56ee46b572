"""The faults of one simulated node, acted between its SDO server and the network.

Time is passed in; waiting is the caller's. Does not know how a fault is written (`faults`), nor buses or threads.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from dvtcli.simulator.faults import Fault, FaultKind
from dvtcli.simulator.memory import STORE
from dvtcli.simulator.sdo_server import INITIATE_DOWNLOAD, INITIATE_UPLOAD, UPLOAD_SEGMENT, SdoServer

_TOGGLE, _EXPEDITED = 0x10, 0x02
#: kinds whose download does not reach the device
_NEVER_TAKEN = (FaultKind.LOSE_REQUEST, FaultKind.RESET, FaultKind.SILENT, FaultKind.BUS_ERROR)


@dataclass(frozen=True, slots=True)
class Answer:
    """What the server sends on a request: *frames* in order, *delay_s* seconds after it."""

    frames: tuple[bytes, ...] = ()
    delay_s: float = 0.0


class FaultyServer:
    """*server* with *faults*; ValueError where two of them happen at the same download.

    *dead* says that the node is off for good, *bus_failed* that the bus is. A node that resets is INITIALISING until
    *boots_at_s*; who calls `handle` boots it then.
    """

    def __init__(self, server: SdoServer, faults: Iterable[Fault]) -> None:
        self._server = server
        self._due: dict[int, Fault] = {}
        self._store_delay_s = 0.0
        self._wrong_toggle = False
        #: an upload that is answered in segments on purpose: its data
        self._segmented: bytes | None = None
        self.downloads = 0
        self.dead = False
        self.bus_failed = False
        self.boots_at_s: float | None = None
        for fault in faults:
            self._add(fault)

    def _add(self, fault: Fault) -> None:
        if fault.at is not None:
            if fault.at in self._due:
                raise ValueError(f"{self._due[fault.at]} and {fault} happen at the same download")
            self._due[fault.at] = fault
        elif fault.kind is FaultKind.SLOW_STORE:
            self._store_delay_s = fault.seconds or 0.0
        else:
            self._server.device.store_fails = True

    def handle(self, request: bytes, now_s: float) -> Answer:
        """The answer to *request* at *now_s*, faults included."""
        if len(request) == 8 and request[0] >> 5 == INITIATE_DOWNLOAD:
            self.downloads += 1
            fault = self._due.pop(self.downloads, None)
            answer = self._plain(request) if fault is None else self._acted(fault, request, now_s)
            if int.from_bytes(request[1:3], "little") == STORE:
                return Answer(answer.frames, answer.delay_s + self._store_delay_s)
            return answer
        return self._plain(request)

    def _acted(self, fault: Fault, request: bytes, now_s: float) -> Answer:
        if fault.kind is FaultKind.REFUSE:
            return Answer((b"\x80" + request[1:4] + (fault.code or 0).to_bytes(4, "little"),))
        if fault.kind in _NEVER_TAKEN:
            self._lose(fault, now_s)
            return Answer()
        self._wrong_toggle = fault.kind is FaultKind.TOGGLE
        frames = self._plain(request).frames
        match fault.kind:
            case FaultKind.LOSE_RESPONSE:
                return Answer()
            case FaultKind.LATE:
                return Answer(frames, fault.seconds or 0.0)
            case FaultKind.DUPLICATE:
                return Answer(frames * 2)
            case FaultKind.FOREIGN:
                return Answer((_for_another_object(request), *frames))
            case FaultKind.MALFORMED:
                return Answer(tuple(frame[:3] for frame in frames))
        return Answer(frames)

    def _lose(self, fault: Fault, now_s: float) -> None:
        """The request is not taken; most kinds break more than that."""
        self.dead = fault.kind is FaultKind.SILENT
        self.bus_failed = fault.kind is FaultKind.BUS_ERROR
        if fault.kind is FaultKind.RESET:
            self._reset(now_s + (fault.seconds or 0.0))

    def _reset(self, boots_at_s: float) -> None:
        self._server.device.restart()
        self._server.reset()
        self._segmented = None
        self.boots_at_s = boots_at_s

    def _plain(self, request: bytes) -> Answer:
        """The server's own answer; the toggle bit is wrong in the first segment after it was asked for."""
        specifier = request[0] >> 5 if len(request) == 8 else None
        if specifier == UPLOAD_SEGMENT and self._segmented is not None:
            data, self._segmented = self._segmented, None
            head = (request[0] & _TOGGLE ^ _TOGGLE) | (7 - len(data)) << 1 | 1
            return Answer((bytes([head]) + data.ljust(7, b"\0"),))
        self._segmented = None
        response = self._server.handle(request)
        if response is None:
            return Answer()
        if self._wrong_toggle and response[0] != 0x80:
            response = self._with_wrong_toggle(specifier, response)
        return Answer((response, *self._server.take_more()))

    def _with_wrong_toggle(self, specifier: int | None, response: bytes) -> bytes:
        """*response*, spoilt if it is a segment; an expedited read is turned into one of segments, as servers may."""
        if specifier == INITIATE_UPLOAD and response[0] & _EXPEDITED:
            self._wrong_toggle = False
            self._segmented = response[4 : 8 - (response[0] >> 2 & 3)]
            return b"\x41" + response[1:4] + len(self._segmented).to_bytes(4, "little")
        if specifier in (INITIATE_UPLOAD, INITIATE_DOWNLOAD):
            return response
        self._wrong_toggle = False
        return bytes([response[0] ^ _TOGGLE]) + response[1:]


def _for_another_object(request: bytes) -> bytes:
    """The acknowledgement of a download beside the one that was asked for: what a lenient client takes for its own."""
    return b"\x60" + request[1:3] + bytes([request[3] ^ 0x40]) + bytes(4)
