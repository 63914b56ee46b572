"""Simulated nodes on a python-can bus, served by one thread: met as real ones are.

Does not own the bus: who opened it shuts it down, after `stop`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import can

from dvtcli.bus.can_message import frame_of
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.in_process_bus import NodesOnABus

if TYPE_CHECKING:
    from dvtcli.simulator.network.signals import SimulatedSignal

#: Longest wait for a frame, in seconds: bounds how long `stop` takes, never how long an answer takes.
_LONGEST_WAIT_S = 0.05


class ServedNodes:
    """Serves *devices* on *bus* between `start` and `stop`; also a context manager.

    *faults* go wrong with them, *signals* move them; where a fault kills the bus, *on_bus_error* is called once, from
    the serving thread. With *bit_rate* (bit/s) nodes are heard by who is tuned to theirs. *lock* is held while a frame
    is dealt with; take it to look at a device or to change it from another thread. *error* is what ended the thread
    early, None otherwise.
    """

    def __init__(
        self,
        bus: can.BusABC,
        devices: Sequence[StrictDevice],
        faults: Sequence[Fault] = (),
        signals: Sequence[SimulatedSignal] = (),
        on_bus_error: Callable[[], None] = lambda: None,
        *,
        bit_rate: int | None = None,
    ) -> None:
        self.bus = bus
        self._nodes_on_it = NodesOnABus(devices, faults, signals, self._say, bit_rate=bit_rate)
        self.nodes = self._nodes_on_it.nodes
        self._on_bus_error = on_bus_error
        self._bus_failed = False
        self.lock = threading.Lock()
        self.error: can.CanError | None = None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> ServedNodes:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Boot every node, then serve until `stop`; the boot-ups are on the bus when this returns."""
        self._nodes_on_it.boot(time.monotonic())
        self._stopping.clear()
        self._thread = threading.Thread(target=self._serve, name="simulated nodes", daemon=True)
        self._thread.start()

    def tune(self, bit_rate: int, *, listening: bool) -> None:
        """Who is on *bus* speaks at *bit_rate* (bit/s, 0: not at all) from now on, or is only *listening*."""
        with self.lock:
            self._nodes_on_it.bit_rate, self._nodes_on_it.only_received = bit_rate, listening

    def stop(self) -> None:
        """End the thread within 50 ms; may be called twice."""
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
            self._thread = None

    def _serve(self) -> None:
        try:
            while not self._stopping.is_set():
                message = self.bus.recv(self._wait_s())
                with self.lock:
                    if message is None:
                        self._nodes_on_it.pass_time(time.monotonic())
                    elif not message.is_error_frame:
                        self._nodes_on_it.hear(frame_of(message), time.monotonic())
                    if self._nodes_on_it.bus_failed and not self._bus_failed:
                        self._bus_failed = True
                        self._on_bus_error()
        except can.CanError as error:
            self.error = error

    def _wait_s(self) -> float:
        """Seconds until a node has something to send by itself, at most 0.05."""
        return min(_LONGEST_WAIT_S, max(0.0, self._nodes_on_it.next_s() - time.monotonic()))

    def _say(self, frame: Frame, _at_s: float) -> None:
        self.bus.send(
            can.Message(
                arbitration_id=frame.can_id,
                data=frame.data,
                is_extended_id=frame.extended,
                is_remote_frame=frame.remote,
            )
        )
