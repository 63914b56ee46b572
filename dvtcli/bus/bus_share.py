"""Waiting time before a request: for a share of the bus load, and for the pace of parallel requests.

The load is measured from recent frames.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING

from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.frame_bits import frame_bits, most_frame_bits
from dvtcli.domain.ports import Frame

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus


#: how much of the wire all frames together may take (%): a frame that has to wait for a gap waits some ten milliseconds
FULL_PERCENT = 95
#: time by which requests are sent ahead of the wire (s), to compensate a late thread
AHEAD_S = 0.002
#: maximum wait of a request (s): even if others exceed the share, a transfer ends
LONGEST_WAIT_S = 1.0
_MOST_BITS = most_frame_bits(8)
_ABORT = 0x80


class WirePace:
    """The pace on a wire at *bit_rate* bit/s; *now_s* returns the time in seconds. Thread-safe."""

    def __init__(self, bit_rate: int, now_s: Callable[[], float]) -> None:
        self._bit_s = 100 / FULL_PERCENT / bit_rate
        self._now_s = now_s
        self._lock = Lock()
        #: time until which the wire is busy with counted frames
        self._busy_until_s = now_s()
        #: requests that have their time and were not sent yet, and nodes that owe an answer: both are counted as long
        #: as can be until they pass
        self._reserved = 0
        self._owed: set[int] = set()

    def slot_s(self) -> float:
        """Time at which the next request may be sent, in the order of the calls."""
        with self._lock:
            now_s = self._now_s()
            self._busy_until_s = min(max(self._busy_until_s, now_s), now_s + LONGEST_WAIT_S)
            slot_s = max(now_s, self._busy_until_s - AHEAD_S)
            self._busy_until_s += 2 * _MOST_BITS * self._bit_s
            self._reserved += 1
        return slot_s

    def count(self, frame: Frame, sent: bool) -> None:
        """Count a passing frame (Tap)."""
        with self._lock:
            bits = frame_bits(frame.can_id, frame.data, frame.extended, frame.remote) - self._counted(frame, sent)
            self._busy_until_s = max(self._busy_until_s, self._now_s()) + bits * self._bit_s

    def _counted(self, frame: Frame, sent: bool) -> int:
        """Bits counted before for *frame*, or made superfluous by it; below 0: more follow."""
        function, node_id = (0 if frame.extended else frame.can_id & ~0x7F), frame.can_id & 0x7F
        owes = node_id in self._owed
        if function == SDO_RESPONSE_BASE and owes and not sent:
            self._owed.remove(node_id)
            return _MOST_BITS
        if function != SDO_REQUEST_BASE or not sent or not frame.data or frame.data[0] == _ABORT:
            return 0
        self._owed.add(node_id)
        counted = _MOST_BITS if owes else 0  # an earlier request will not be answered any more
        if self._reserved:
            self._reserved -= 1
            return counted + _MOST_BITS
        return counted - _MOST_BITS


class PaceLimiter:
    """The pace of *bus*, whose frames are counted from the first waiting request until `rest`."""

    def __init__(self, bus: CanopenBus) -> None:
        self._bus = bus
        self._lock = Lock()
        self._pace: WirePace | None = None
        self._end_counting: Callable[[], None] = lambda: None

    def wait(self, bit_rate: int) -> None:
        """Wait until a request may go, at *bit_rate* bit/s."""
        with self._lock:
            if self._pace is None:
                self._pace = WirePace(bit_rate, self._bus.now_s)
                self._end_counting = self._bus.tap(self._pace.count)
            wait_s = self._pace.slot_s() - self._bus.now_s()
        if wait_s > 0:
            self._bus.sleep(wait_s)

    def rest(self) -> None:
        """Stop counting: no request is under way any more."""
        with self._lock:
            self._end_counting()
            self._pace, self._end_counting = None, lambda: None


#: an SDO request and its answer, with worst-case stuffing
EXCHANGE_BITS = 2 * most_frame_bits(8)
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
        if function == SDO_RESPONSE_BASE:
            return
        is_request = function == SDO_REQUEST_BASE
        bits = EXCHANGE_BITS if is_request else frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)
        self._frames.append((self._now_s(), bits))
        self._bits += bits
        self._expire()

    def wait_s(self) -> float:
        """Waiting time (s) for the next exchange as known now; 0 if the share has room."""
        self._expire()
        left = self._bits
        if left <= self._room:
            return 0.0
        for at_s, bits in tuple(self._frames):
            left -= bits
            if left <= self._room:
                return max(at_s + self.window_s - self._now_s(), TICK_S)
        return self.window_s

    def _expire(self) -> None:
        """Drop frames older than the window."""
        since_s = self._now_s() - self.window_s
        while self._frames and self._frames[0][0] <= since_s:
            self._bits -= self._frames.popleft()[1]


class ShareLimiter:
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
