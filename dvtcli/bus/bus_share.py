"""Waiting time before a request that keeps the bus load at or below a share.

The load is measured from recent frames.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING

from dvtcli.bus.sdo.sdo_link import ANSWER_ID, REQUEST_ID
from dvtcli.domain.bus_load import frame_bits, most_frame_bits
from dvtcli.domain.ports import Frame

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus

#: an SDO request and its answer, with worst-case stuffing
EXCHANGE_BITS = 2 * most_frame_bits(8)
#: maximum wait of a request for its share (s): even if others exceed the share, a transfer ends
LONGEST_WAIT_S = 1.0
#: the shortest wait (s)
TICK_S = 0.001
_WINDOW_S, _EXCHANGES_IN_A_WINDOW = 0.1, 4


class BusShare:
    """The load of a bus of *bit_rate* bit/s, of which at most *percent* (1..100) may be used.

    *now_s* returns the time in seconds. The limit holds for each window of 0.1 s, longer on slow buses, and so for any
    second.
    """

    def __init__(self, bit_rate: int, percent: int, now_s: Callable[[], float]) -> None:
        allowed = bit_rate * percent / 100
        self.percent = percent
        self.window_s = min(1.0, max(_WINDOW_S, _EXCHANGES_IN_A_WINDOW * EXCHANGE_BITS / allowed))
        self._room = allowed * self.window_s - EXCHANGE_BITS
        self._now_s = now_s
        self._frames: deque[tuple[float, int]] = deque()
        self._bits = 0

    def count(self, frame: Frame, _sent: bool) -> None:
        """Count a passing frame (Tap); an SDO request counts for its answer, too."""
        function = 0 if frame.extended else frame.can_id & ~0x7F
        if function == ANSWER_ID:
            return
        is_request = function == REQUEST_ID
        bits = EXCHANGE_BITS if is_request else frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)
        self._frames.append((self._now_s(), bits))
        self._bits += bits
        self._forget()

    def wait_s(self) -> float:
        """Waiting time (s) for the next exchange as known now; 0 if the share has room."""
        self._forget()
        left = self._bits
        if left <= self._room:
            return 0.0
        for at_s, bits in tuple(self._frames):
            left -= bits
            if left <= self._room:
                return max(at_s + self.window_s - self._now_s(), TICK_S)
        return self.window_s

    def _forget(self) -> None:
        """Drop frames older than the window."""
        since_s = self._now_s() - self.window_s
        while self._frames and self._frames[0][0] <= since_s:
            self._bits -= self._frames.popleft()[1]


class KeptShare:
    """The load of *bus*, at *bit_rate* bit/s, measured only while a limit applies."""

    def __init__(self, bus: CanopenBus, bit_rate: int) -> None:
        self._bus = bus
        self._bit_rate = bit_rate
        self._share: BusShare | None = None
        self._end_measuring: Callable[[], None] = lambda: None
        self._lock = Lock()

    def wait(self, percent: int) -> None:
        """Wait until an exchange leaves the load within *percent* (1..99; 0: no limit), 1 s at most.

        The caller must have processed all received frames.
        """
        share = self._measured(percent)
        if share is None:
            return
        until_s = self._bus.now_s() + LONGEST_WAIT_S
        while (wait_s := share.wait_s()) and (left_s := until_s - self._bus.now_s()) > 0:
            self._bus.sleep(min(wait_s, left_s))

    def _measured(self, percent: int) -> BusShare | None:
        """The load, after a first measurement; None without a limit."""
        with self._lock:
            share = self._share
            if share is not None and share.percent == percent:
                return share
            self._end_measuring()
            self._share, self._end_measuring = None, lambda: None
            if not percent:
                return None
            self._share = share = BusShare(self._bit_rate, percent, self._bus.now_s)
            self._end_measuring = self._bus.tap(share.count)
        self._bus.sleep(share.window_s)
        return share
