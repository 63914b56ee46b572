"""What a node really holds, read past the cable by a few lines of SDO of our own; and its restarts."""

from __future__ import annotations

import struct
import time
from dataclasses import dataclass, field

import can

from tests.benchmarks.bench_serve import Sim

Held = dict[tuple[int, int], int]
#: the PDOs that are changed: two of each direction
_COMMUNICATION = (0x1400, 0x1401, 0x1800, 0x1801)
_MAPPING = (0x1600, 0x1601, 0x1A00, 0x1A01)
_UPLOAD, _ABORT, _EXPEDITED = 0x40, 0x80, 0x43
#: how long a node may be silent, as one that restarts is (s)
_PATIENCE_S = 30.0


@dataclass
class Truth:
    """The node *node_id* of *server*. All that it holds here is up to 4 bytes long."""

    server: Sim
    node_id: int
    restarts: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._bus = self.server.bus()

    def held(self) -> Held:
        """Every parameter of the PDOs that are changed, as they are at one time; where one is not there: -1."""
        self.listen()  # what was answered to others is of then, not of now
        while True:
            restarts = self.restarts
            found = self._read()
            self.listen()
            if self.restarts == restarts:
                return found

    def _read(self) -> Held:
        found: Held = {}
        for index in _COMMUNICATION:
            for sub in (1, 2, 3, 5):
                found[index, sub] = self._number(index, sub)
        for index in _MAPPING:
            count = found[index, 0] = self._number(index, 0)
            for sub in range(1, count + 1):
                found[index, sub] = self._number(index, sub)
        return found

    def listen(self) -> None:
        """Take in what came meanwhile."""
        while (frame := self._bus.recv(0.02)) is not None:
            self._received(frame)

    def _number(self, index: int, sub: int) -> int:
        """An object by SDO upload; of the answers on the bus, which are also for others, the one to this object."""
        asked = struct.pack("<BHB4x", _UPLOAD, index, sub)
        until_s = time.monotonic() + _PATIENCE_S
        while time.monotonic() < until_s:
            self._bus.send(can.Message(arbitration_id=0x600 + self.node_id, data=asked, is_extended_id=False))
            again_s = time.monotonic() + 1.0
            while time.monotonic() < again_s:
                frame = self._bus.recv(0.1)
                if frame is None or self._received(frame) or frame.arbitration_id != 0x580 + self.node_id:
                    continue
                command, of, its = struct.unpack_from("<BHB", frame.data)
                if (of, its) != (index, sub):
                    continue
                if command == _ABORT:
                    return -1
                if command & 0xE3 == _EXPEDITED:
                    return int.from_bytes(frame.data[4 : 8 - (command >> 2 & 3)], "little")
        raise AssertionError(f"node {self.node_id} is silent past the cable")

    def _received(self, frame: can.Message) -> bool:
        """Whether *frame* is the node's boot-up message."""
        restarted = frame.arbitration_id == 0x700 + self.node_id and bytes(frame.data) == b"\0"
        self.restarts += restarted
        return restarted

    @staticmethod
    def reset(server: Sim, node_id: int) -> None:
        """Another master's reset of the node."""
        bus = server.bus()
        bus.send(can.Message(arbitration_id=0, data=struct.pack("BB", 0x81, node_id), is_extended_id=False))
        time.sleep(0.05)
        bus.shutdown()

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()
