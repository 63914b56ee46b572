"""A bus on which only simulated devices live; nothing leaves this process.

Does not know how a device behaves (see dvtcli.simulator).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from time import monotonic, sleep
from typing import TYPE_CHECKING

import can
from can.interfaces.virtual import VirtualBus

from dvtcli.bus.python_can import CanBus
from dvtcli.bus.sdo.link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.simulated_network import SimulatedNetwork

if TYPE_CHECKING:
    from dvtcli.simulator.device.faults import Fault
    from dvtcli.simulator.device.signals import Signal

#: how late the nodes' thread may be (s), and how often it is looked whether it still is
_LATE_S, _LOOK_S = 30.0, 0.0005
#: python-can's virtual channels are shared by name within a process: each simulation has its own
_NUMBERS = count(1)


class OurSide(VirtualBus):
    """Our side of a virtual bus, dead once *failed* is set, as after an adapter was unplugged.

    Time passes for the nodes of *network* as it does for us: on a busy machine their thread may come late, which is no
    late answer. So nothing was received only where the nodes have dealt with all that was sent.
    """

    failed = False
    network: SimulatedNetwork | None = None
    _sent = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send *msg*; CanOperationError where the bus is dead."""
        self._check_if_alive()
        super().send(msg, timeout)
        self._sent += 1

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self._check_if_alive()
        received = super()._recv_internal(timeout)
        if received[0] is None and self._nodes_come_late():
            received = super()._recv_internal(0)
        self._check_if_alive()
        return received

    def _nodes_come_late(self) -> bool:
        """Wait until the nodes have dealt with what was sent; False where they had."""
        network, until_s = self.network, monotonic() + _LATE_S
        if network is None or network.handled >= self._sent:
            return False
        while network.handled < self._sent and network.serving and monotonic() < until_s:
            sleep(_LOOK_S)
        return True

    def _check_if_alive(self) -> None:
        if self.failed:
            raise can.CanOperationError("the bus has failed (a simulated fault)")


def simulate(
    devices: Sequence[StrictDevice],
    *,
    faults: Sequence[Fault] = (),
    signals: Sequence[Signal] = (),
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
) -> CanBus:
    """Start *devices*, with their *faults* and *signals*, on a bus of their own and join it; closing it stops them."""
    channel = f"dvtcli-sim-{next(_NUMBERS)}"
    # Our side first: the nodes' boot-up messages are sent once.
    ours = OurSide(channel)
    theirs = can.Bus(channel, interface="virtual", ignore_config=True)

    def fail() -> None:
        ours.failed = True

    network = SimulatedNetwork(theirs, devices, faults, signals, on_bus_error=fail)
    network.start()
    ours.network = network

    def stop() -> None:
        # A frame that means nothing wakes the nodes' thread, which else would notice its end some 50 ms later.
        with can.Bus(channel, interface="virtual", ignore_config=True) as waker:
            waker.send(can.Message(is_error_frame=True))
            network.stop()
        theirs.shutdown()

    bus = CanBus(ours, "sim", simulated=True, timeout_s=timeout_s, retries=retries, on_close=stop)
    bus.echoes.rule_out()
    return bus
