"""A virtual CAN bus with served nodes, met over python-can as a real one, and a recorder of every frame on it."""

from __future__ import annotations

from itertools import count
from types import TracebackType

import can

from dvtcli.formats.eds import read_eds
from dvtcli.simulator.device import StrictDevice
from dvtcli.simulator.family import family_eds, load_family
from dvtcli.simulator.node import SimulatedNetwork

_NUMBERS = count(1)


def device(family: str, node_id: int = 1) -> StrictDevice:
    return StrictDevice(read_eds(family_eds(family)).dictionary, load_family(family), node_id)


class Wire:
    """Serves *devices* on a channel of its own."""

    def __init__(self, *devices: StrictDevice) -> None:
        self.channel = f"wire-{next(_NUMBERS)}"
        self._recorder = can.Bus(self.channel, interface="virtual", ignore_config=True)
        self._theirs = can.Bus(self.channel, interface="virtual", ignore_config=True)
        self._network = SimulatedNetwork(self._theirs, devices)

    def __enter__(self) -> Wire:
        self._network.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._network.stop()
        self._theirs.shutdown()
        self._recorder.shutdown()

    @property
    def options(self) -> dict[str, object]:
        """What dvtcli needs to meet the nodes."""
        return {"interface": "virtual", "channel": self.channel, "node": 1}

    def frames(self) -> list[can.Message]:
        """Every frame since the last call, from all sides."""
        seen: list[can.Message] = []
        while (message := self._recorder.recv(0)) is not None:
            seen.append(message)
        return seen
