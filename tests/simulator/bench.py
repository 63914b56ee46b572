"""A work bench: simulated devices by family, and an SDO client of its own that speaks frames to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.sdo_server import SdoServer
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.bus.devices import dictionary


class Aborted(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


class Silent(Exception):
    """The server did not answer."""


def booted(family: str = "generic", node_id: int = 1) -> StrictDevice:
    device = StrictDevice(dictionary(family), load_family(family), node_id)
    device.boot_up()
    device.take_outbox()
    return device


def multiplexer(index: int, sub_index: int) -> bytes:
    return index.to_bytes(2, "little") + bytes([sub_index])


class Server(Protocol):
    """What answers SDO requests."""

    def handle(self, request: bytes) -> bytes | None:
        """The answer to *request*, None for silence."""
        ...


class Bench(Protocol):
    """A node under test as a table of probes needs it, wherever it is."""

    @property
    def client(self) -> Client: ...

    def nmt(self, command: NmtCommand) -> None:
        """Send an NMT command, and wait until it was obeyed."""
        ...

    def sync(self) -> list[Frame]:
        """Send a SYNC; the PDOs that come in answer."""
        ...

    def receive(self, frame: Frame) -> list[Frame]:
        """Send *frame*; the PDOs and EMCYs that come in answer."""
        ...

    def events(self, can_id: int, duration_ms: int) -> int:
        """How many frames *can_id* the node sends by itself in so many ms."""
        ...


class InProcess:
    """A node in this process, with a clock that goes as fast as it is looked at."""

    def __init__(self, device: StrictDevice) -> None:
        self.device = device
        self.client = Client.on(device)
        self._now_ms = 0

    def nmt(self, command: NmtCommand) -> None:
        self.device.nmt(command)
        self.device.take_outbox()

    def sync(self) -> list[Frame]:
        return self.device.services.sync()

    def receive(self, frame: Frame) -> list[Frame]:
        return self.device.services.receive(frame)

    def events(self, can_id: int, duration_ms: int) -> int:
        self.device.services.poll(self._now_ms / 1000)
        began_ms, self._now_ms = self._now_ms, self._now_ms + duration_ms + 1
        polls = [self.device.services.poll(ms / 1000) for ms in range(began_ms + 1, self._now_ms + 1)]
        return sum(frame.can_id == can_id for sent in polls for frame in sent)


@dataclass
class Client:
    """An SDO client straight on a server: expedited where it fits, else (or on demand) segmented."""

    server: Server

    @classmethod
    def on(cls, device: StrictDevice) -> Client:
        return cls(SdoServer(device))

    def ask(self, request: bytes) -> bytes:
        response = self.server.handle(request.ljust(8, b"\0"))
        if response is None:
            raise Silent
        assert len(response) == 8
        if response[0] == 0x80:
            raise Aborted(int.from_bytes(response[4:], "little"))
        return response

    def read(self, index: int, sub_index: int = 0) -> bytes:
        response = self.ask(b"\x40" + multiplexer(index, sub_index))
        assert response[1:4] == multiplexer(index, sub_index)
        if response[0] & 0x02:
            return response[4 : 8 - (response[0] >> 2 & 3)]
        size, data, toggle = int.from_bytes(response[4:], "little"), b"", 0
        while True:
            segment = self.ask(bytes([0x60 | toggle]))
            assert segment[0] & 0x10 == toggle
            data += segment[1 : 8 - (segment[0] >> 1 & 7)]
            if segment[0] & 1:
                assert len(data) == size
                return data
            toggle ^= 0x10

    def number(self, index: int, sub_index: int = 0) -> int:
        return int.from_bytes(self.read(index, sub_index), "little")

    def write(self, index: int, sub_index: int, value: int, size: int) -> None:
        self.write_bytes(index, sub_index, value.to_bytes(size, "little"))

    def write_bytes(self, index: int, sub_index: int, data: bytes) -> None:
        if not 1 <= len(data) <= 4:
            self.write_segmented(index, sub_index, data)
            return
        head = bytes([0x23 | (4 - len(data)) << 2])
        assert self.ask(head + multiplexer(index, sub_index) + data)[0] == 0x60

    def write_segmented(self, index: int, sub_index: int, data: bytes) -> None:
        self.ask(b"\x21" + multiplexer(index, sub_index) + len(data).to_bytes(4, "little"))
        toggle = 0
        for start in range(0, max(len(data), 1), 7):
            part = data[start : start + 7]
            head = toggle | (7 - len(part)) << 1 | (start + 7 >= len(data))
            assert self.ask(bytes([head]) + part)[0] == 0x20 | toggle
            toggle ^= 0x10
