"""A bus on which only simulated devices live; nothing leaves this process.

Does not know how a device behaves (see dvtcli.simulator).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

import can

from dvtcli.simulator.device import StrictDevice
from dvtcli.simulator.node import SimulatedNetwork
from dvtcli.transports import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.transports.canbus import CanBus

#: python-can's virtual channels are shared by name within a process: each simulation has its own
_NUMBERS = count(1)


def simulate(
    devices: Sequence[StrictDevice], *, timeout_s: float = DEFAULT_TIMEOUT_S, retries: int = DEFAULT_RETRIES
) -> CanBus:
    """Start *devices* on a bus of their own and join it; closing the bus stops them."""
    channel = f"dvtcli-sim-{next(_NUMBERS)}"
    # Our side first: the nodes' boot-up messages are sent once.
    ours = can.Bus(channel, interface="virtual", ignore_config=True)
    theirs = can.Bus(channel, interface="virtual", ignore_config=True)
    network = SimulatedNetwork(theirs, devices)
    network.start()

    def stop() -> None:
        # A frame that means nothing wakes the nodes' thread, which else would notice its end some 50 ms later.
        with can.Bus(channel, interface="virtual", ignore_config=True) as waker:
            waker.send(can.Message(is_error_frame=True))
            network.stop()
        theirs.shutdown()

    return CanBus(ours, "sim", simulated=True, timeout_s=timeout_s, retries=retries, on_close=stop)
