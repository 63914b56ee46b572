"""What a simulated node really holds, read by canopen's own SDO client over the frames of the same bus."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass

import canopen
from canopen.sdo.client import SdoClient

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.in_process_bus import InProcessBus
from tests.cli.commands.bench import Bench

#: What is read of each PDO: these sub-indices of its communication parameter, and as many entries as its count says.
_SUB_INDICES = (1, 2, 3, 5, 6)


@dataclass(frozen=True)
class RawPdo:
    """The values of one PDO; None for what the node does not tell."""

    parameters: tuple[int | None, ...]
    count: int | None
    entries: tuple[int | None, ...]

    @property
    def cob_id(self) -> int | None:
        return self.parameters[0]

    @property
    def is_off(self) -> bool:
        return self.cob_id is None or bool(self.cob_id >> 31)


class _Wire(canopen.Network):
    """The bus as canopen's client uses a network: it sends on it; what comes is what passes on the bus."""

    def __init__(self, bus: InProcessBus) -> None:
        super().__init__()
        self._bus = bus

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._bus.send_sdo(can_id, bytes(data))


class _Client(SdoClient):
    """canopen's client, which reads its bus itself instead of in a thread; patient on a busy machine."""

    RESPONSE_TIMEOUT = 30

    def __init__(self, bus: InProcessBus, node_id: int) -> None:
        super().__init__(0x600 + node_id, 0x580 + node_id, canopen.ObjectDictionary())
        self.network = _Wire(bus)
        self._bus = bus
        self.forget = bus.tap(self._hear)

    def _hear(self, frame: Frame, sent: bool) -> None:
        if frame.can_id == self.tx_cobid and not sent:
            self.responses.put(bytes(frame.data))

    def read_response(self) -> bytes:
        end_s = time.monotonic() + self.RESPONSE_TIMEOUT
        self._bus.drain()
        while self.responses.empty() and time.monotonic() < end_s:
            self._bus.idle(0.01)
        answer: bytes = super().read_response()
        return answer


class Independent:
    """canopen's client of the one node of *bench*; it only reads."""

    def __init__(self, bench: Bench) -> None:
        bus = bench.session.open_network().bus
        assert isinstance(bus, InProcessBus)
        self._bus = bus
        self._client = _Client(self._bus, bench.session.node_id())

    def close(self) -> None:
        self._client.forget()

    def number(self, index: int, sub_index: int) -> int | None:
        """An object's value; None where the node refuses to tell it."""
        try:
            data: bytes = self._client.upload(index, sub_index)
        except canopen.SdoAbortedError:
            return None
        return int.from_bytes(data, "little")

    def pdo(self, communication: int, mapping: int) -> RawPdo:
        parameters = tuple(self.number(communication, sub_index) for sub_index in _SUB_INDICES)
        count = self.number(mapping, 0)
        places = range(1, min(count or 0, 64) + 1)
        return RawPdo(parameters, count, tuple(self.number(mapping, place) for place in places))

    def pdos(self, places: Iterable[tuple[int, int]]) -> dict[tuple[int, int], RawPdo]:
        found = {place: self.pdo(*place) for place in places}
        self._bus.idle(0)  # what our reading said is no news to the session
        return found
