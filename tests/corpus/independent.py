"""What a simulated node really holds, read by canopen's own SDO client on a channel of its own to the same bus."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import can
import canopen
from canopen.sdo.client import SdoClient

from tests.commands.bench import Bench

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


class _Client(SdoClient):
    """canopen's client, which reads its bus itself instead of in a thread; patient on a busy machine."""

    RESPONSE_TIMEOUT = 30

    def read_response(self) -> bytes:
        while (message := self.network.bus.recv(self.RESPONSE_TIMEOUT)) is not None:
            if message.arbitration_id == self.tx_cobid:
                self.responses.put(bytes(message.data))
                break
        answer: bytes = super().read_response()
        return answer


class Independent:
    """canopen's client of the one node of *bench*; it only reads."""

    def __init__(self, bench: Bench) -> None:
        self._bus = bench.session.open_network().bus
        node_id = bench.session.node_id()
        self._wire = can.Bus(self._bus._bus.channel_id, interface="virtual", ignore_config=True)
        network = canopen.Network(self._wire)
        self._client = _Client(0x600 + node_id, 0x580 + node_id, canopen.ObjectDictionary())
        self._client.network = network

    def close(self) -> None:
        self._wire.shutdown()

    def number(self, index: int, sub_index: int) -> int | None:
        """An object's value; None where the node refuses to tell it."""
        try:
            while self._wire.recv(0) is not None:
                pass  # what the tool and the node said to each other
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
