"""A virtual CAN bus with served nodes, met over python-can as a real one, and a recorder of every frame on it."""

from __future__ import annotations

import threading
from itertools import count
from types import TracebackType

import can

from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.bus.devices import dictionary
from tests.process import PATIENCE_S
from tests.served_nodes import ServedNodes

_NUMBERS = count(1)


def device(family: str, node_id: int = 1) -> StrictDevice:
    return StrictDevice(dictionary(family), load_family(family), node_id)


class Wire:
    """Serves *devices* on a channel of its own; *faults* are words of `--fault`."""

    def __init__(self, *devices: StrictDevice, faults: tuple[str, ...] = ()) -> None:
        self.channel = f"wire-{next(_NUMBERS)}"
        self._recorder = can.Bus(self.channel, interface="virtual", ignore_config=True)
        self._theirs = can.Bus(self.channel, interface="virtual", ignore_config=True)
        self._network = ServedNodes(self._theirs, devices, [Fault.parse(word) for word in faults])

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
        """What dvtcli needs to meet the nodes, with patience: they answer in a thread beside it."""
        return {"interface": "virtual", "channel": self.channel, "node": 1, "timeout": PATIENCE_S}

    @property
    def lock(self) -> threading.Lock:
        """Held while a frame is dealt with: take it to touch a device."""
        return self._network.lock

    def power_cycle(self, device: StrictDevice) -> None:
        """Switch *device* off and on: its boot-up is sent by the network's thread."""
        with self._network.lock:
            device.restart()
            device.boot_up()

    def frames(self) -> list[can.Message]:
        """Every frame since the last call, from all sides."""
        seen: list[can.Message] = []
        while (message := self._recorder.recv(0)) is not None:
            seen.append(message)
        return seen
