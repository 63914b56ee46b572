"""An existing bus joined by simulated nodes; a thread collects its frames."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue

from dvtcli.domain.ports import CanopenBus, Frame
from dvtcli.errors import BusUnavailable

#: Waits for the bus that failed until it is back, or (None) until the function that it is given says to stop.
ComeBack = Callable[[CanopenBus, BusUnavailable, Callable[[], bool]], CanopenBus | None]
#: how long the thread listens before it looks whether it should end (s)
_LISTEN_S = 0.2


class JoinedBus:
    """*bus* as a member; *wake* is called from another thread after a frame or a failure.

    With *come_back* a lost bus is waited for; frames of the nodes are lost meanwhile.
    """

    def __init__(self, bus: CanopenBus, wake: Callable[[], None], come_back: ComeBack | None = None) -> None:
        self._bus = bus
        self._wake = wake
        self._come_back = come_back
        self._arrived: SimpleQueue[Frame] = SimpleQueue()
        self._failure: BusUnavailable | None = None
        self._leaving = False
        self._untap = bus.tap(self._heard)
        self._thread = threading.Thread(target=self._listen, name=f"listens to {bus.name}", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """The name of the bus for display."""
        return self._bus.name

    def tell(self, frame: Frame) -> None:
        """Send *frame*. Raises BusUnavailable if the bus failed and is not waited for."""
        try:
            self._bus.send(frame)
        except BusUnavailable:
            if self._come_back is None:
                raise

    def heard(self) -> list[Frame]:
        """The frames received since the last call. Raises BusUnavailable if the bus failed."""
        if self._failure is not None:
            raise self._failure
        frames: list[Frame] = []
        while True:
            try:
                frames.append(self._arrived.get_nowait())
            except Empty:
                return frames

    def close(self) -> None:
        """Leave the bus."""
        self._leaving = True
        self._untap()
        self._bus.close()
        self._thread.join()

    def _heard(self, frame: Frame, sent: bool) -> None:
        if not sent:
            self._arrived.put(frame)
            self._wake()

    def _listen(self) -> None:
        while not self._leaving:
            try:
                self._bus.idle(_LISTEN_S)
            except BusUnavailable as failure:
                if self._leaving or not self._is_back(failure):
                    self._failure = failure
                    self._wake()
                    return

    def _is_back(self, failure: BusUnavailable) -> bool:
        """Wait for the failed bus and reconnect; true if it is back."""
        if self._come_back is None:
            return False
        self._bus.close()
        bus = self._come_back(self._bus, failure, lambda: self._leaving)
        if bus is None:
            return False
        self._bus = bus
        self._untap = bus.tap(self._heard)
        return True
