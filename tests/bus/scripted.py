"""A scripted SDO server on a virtual bus: each test says what the node answers, frame by frame."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable

import can
from can.interfaces.virtual import VirtualBus

from tests.process import PATIENCE_S

NODE = 5
#: what the server sends on a request: 8-byte answers, or whole messages
Answers = Iterable[bytes | can.Message]
Script = Callable[[bytes], Answers]


def frame(text: str) -> bytes:
    """Bytes from hexadecimal text, padded to 8."""
    return bytes.fromhex(text).ljust(8, b"\0")


def message(can_id: int, data: bytes, *, extended: bool = False) -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=extended)


def abort(request: bytes, code: int) -> bytes:
    return b"\x80" + request[1:4] + code.to_bytes(4, "little")


def well_behaved(request: bytes) -> list[bytes]:
    """A node that acknowledges expedited writes and answers reads with the object's address."""
    specifier = request[0] >> 5
    if specifier == 2:
        return [b"\x43" + request[1:4] + request[1:4] + b"\0"]
    if specifier == 1:
        return [b"\x60" + request[1:4] + bytes(4)]
    return []


class Steps:
    """A script given as a list: the answers to the first request, to the second, …; aborts by the client are free."""

    def __init__(self, *steps: Answers) -> None:
        self.steps = list(steps)

    def __call__(self, request: bytes) -> Answers:
        if request[0] == 0x80 or not self.steps:
            return []
        return self.steps.pop(0)


class Server:
    """Runs a script as one or more nodes on a virtual channel and records every frame."""

    #: how many frames it has dealt with: their answers are on the bus
    dealt_with = 0

    def __init__(self, channel: str, script: Script) -> None:
        self.bus = can.Bus(channel, interface="virtual", ignore_config=True)
        self.script = script
        self.received: list[can.Message] = []
        self._dealt = threading.Condition()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    @property
    def requests(self) -> list[bytes]:
        """Every SDO request so far, client aborts included."""
        return [bytes(received.data) for received in list(self.received) if received.arbitration_id & 0x780 == 0x600]

    def send(self, can_id: int, data: bytes, *, extended: bool = False) -> None:
        self.bus.send(message(can_id, data, extended=extended))

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()
        self.bus.shutdown()

    def _serve(self) -> None:
        while not self._stopping.is_set():
            received = self.bus.recv(0.01)
            if received is None:
                continue
            self.received.append(received)
            if received.arbitration_id & 0x780 == 0x600:
                self._answer(received)
            with self._dealt:
                self.dealt_with += 1
                self._dealt.notify_all()

    def _answer(self, received: can.Message) -> None:
        for answer in self.script(bytes(received.data)):
            whole = answer if isinstance(answer, can.Message) else message(received.arbitration_id - 0x80, answer)
            self.bus.send(whole)

    def deal_with(self, frames: int) -> None:
        """Wait until it has dealt with as many *frames*."""
        with self._dealt:
            assert self._dealt.wait_for(lambda: self.dealt_with >= frames, PATIENCE_S), "the server is gone"


class Lockstep(VirtualBus):
    """A bus whose frames *server* has dealt with when they are sent: on no machine its answers come too late."""

    server: Server | None = None
    _sent = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._sent += 1
        frames = self._sent
        super().send(msg, timeout)
        if self.server is not None:
            self.server.deal_with(frames)
