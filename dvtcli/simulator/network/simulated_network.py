"""Simulated nodes on a python-can bus, served by one thread.

Does not own the bus: who opened it shuts it down, after `stop`.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import can

from dvtcli.bus.can_message import frame_of, message_of
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import SimulatedNode, stations

if TYPE_CHECKING:
    from dvtcli.simulator.device.faults import Fault
    from dvtcli.simulator.device.signals import Signal

#: Longest wait for a frame, in seconds: bounds how long `stop` takes, never how long an answer takes.
_LONGEST_WAIT_S = 0.05
#: Nodes that answer each other for ever must not keep others out, nor flood the bus: after so many frames it rests (s).
_AT_ONCE, _REST_S = 500, 0.02
#: Frames that nodes have not heard yet; what more they want to send is lost, as on a bus that is never silent.
_MOST_WAITING = 4096


class SimulatedNetwork:
    """Serves *devices* on *bus* between `start` and `stop`; also a context manager.

    Nodes hear each other as well as the bus. *faults* go wrong with them, *signals* move them; where a fault kills the
    bus, *on_bus_error* is called once, from the serving thread. *lock* is held while a frame is dealt with; take it to
    look at a device or to change it from another thread. *error* is what ended the thread early, None otherwise.
    *handled* counts the frames that came over the bus and were answered, where they were to be.
    """

    def __init__(
        self,
        bus: can.BusABC,
        devices: Sequence[StrictDevice],
        faults: Sequence[Fault] = (),
        signals: Sequence[Signal] = (),
        on_bus_error: Callable[[], None] = lambda: None,
    ) -> None:
        self.bus = bus
        self.nodes = stations(devices, faults, signals)
        self._on_bus_error = on_bus_error
        self._bus_failed = False
        self.lock = threading.Lock()
        self.error: can.CanError | None = None
        #: frames of the bus that the nodes have dealt with
        self.handled = 0
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        #: what was said on the bus, with the node that said it, and not heard by the nodes yet
        self._said: deque[tuple[Frame, SimulatedNode | None]] = deque()

    def __enter__(self) -> SimulatedNetwork:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Boot every node, then serve until `stop`; the boot-ups are on the bus when this returns."""
        for node in self.nodes:
            node.device.boot_up()
            self._send(node, node.poll(time.monotonic()))
        self._stopping.clear()
        self._thread = threading.Thread(target=self._serve, name="simulated nodes", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread within 50 ms; may be called twice."""
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
            self._thread = None

    @property
    def serving(self) -> bool:
        """Whether frames are still dealt with."""
        return self._thread is not None and self._thread.is_alive()

    def _serve(self) -> None:
        try:
            while not self._stopping.is_set():
                message = self.bus.recv(self._wait_s())
                with self.lock:
                    if message is not None and not message.is_error_frame:
                        self._said.append((frame_of(message), None))
                    self._settle()
                    self.handled += message is not None
                    self._poll()
                    self._fail_once()
        except can.CanError as error:
            self.error = error

    def _wait_s(self) -> float:
        """Seconds until a node has something to send by itself, at most 0.05."""
        if self._said:
            return _REST_S
        times = [due for node in self.nodes if (due := node.next_poll_s()) is not None]
        return min(_LONGEST_WAIT_S, max(0.0, min(times) - time.monotonic())) if times else _LONGEST_WAIT_S

    def _poll(self) -> None:
        now_s = time.monotonic()
        for node in self.nodes:
            self._send(node, node.poll(now_s))
        self._settle()

    def _fail_once(self) -> None:
        if not self._bus_failed and any(node.bus_failed for node in self.nodes):
            self._bus_failed = True
            self._on_bus_error()

    def _settle(self) -> None:
        """Let every node hear what the others and the bus have said, and what is answered to that."""
        for _ in range(_AT_ONCE):
            if not self._said:
                return
            heard, sender = self._said.popleft()
            for node in self.nodes:
                if node is not sender:
                    self._send(node, node.handle(heard, time.monotonic()))

    def _send(self, node: SimulatedNode, frames: list[Frame]) -> None:
        for frame in frames:
            if len(self._said) >= _MOST_WAITING:
                return
            self.bus.send(message_of(frame))
            self._said.append((frame, node))
