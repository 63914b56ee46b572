"""Record frames at their arrival: a thread reads the bus and does nothing else. Sends nothing."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from time import monotonic, sleep, time
from typing import Protocol

from dvtcli.domain.ports import Frame
from dvtcli.domain.sdo_frame import SDO_CAN_IDS, SdoValues
from dvtcli.errors import BusUnavailable

#: maximum number of waiting frames; further frames are dropped and counted
WAITING = 50_000
#: duration of one read (s): the delay of leaving
TICK_S = 0.1
#: how long more frames are gathered after the first one (s): two threads that take turns frame by frame cost more than
#: the frames
GATHER_S = 0.01
#: a bus clock with a larger difference (s) to the computer's has another epoch
FOREIGN_CLOCK_S = 60.0


class ListenedBus(Protocol):
    """Functions of a bus for listening."""

    def tap(self, callback: Callable[[Frame, bool], None]) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame; returns a function that ends it."""
        ...

    def drain(self) -> None:
        """Deliver received frames without waiting."""
        ...

    def idle(self, duration_s: float) -> None:
        """Read the bus for *duration_s*."""
        ...

    def lost_frame_count(self) -> int:
        """Number of frames lost before they could be read."""
        ...


class Listener:
    """Record all frames on *bus*, including sent frames; at most *waiting* frames are kept.

    Bytes of a *secret* are replaced by zeros: a recording must not reveal a login's passcode.
    Use it in a `with`: recording begins at *began_s* (time.monotonic). Earlier unread frames
    do not count. Frame times are seconds since 1970.
    """

    def __init__(self, bus: ListenedBus, secret: SdoValues, waiting: int = WAITING) -> None:
        self._bus = bus
        self._secret = secret
        self._frames: deque[Frame] = deque()
        self._most = waiting
        self._arrived = threading.Event()
        self._stopping = threading.Event()
        self._clock_s: float | None = None
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._listen, name="listening to frames", daemon=True)
        self._untap: Callable[[], None] = lambda: None
        self._overflowed = 0
        self._lost_before = self._lost = 0
        self.began_s = monotonic()

    @property
    def overflowed(self) -> int:
        """Frames lost because too many waited to be taken."""
        return self._overflowed

    @property
    def dropped(self) -> int:
        """Missing frames: the overflowed frames, and frames that this computer lost before they could be read."""
        if not self._stopping.is_set():
            self._lost = self._bus.lost_frame_count() - self._lost_before
        return self._overflowed + self._lost

    def __enter__(self) -> Listener:
        self._untap = self._bus.tap(self._keep)
        try:
            self._bus.drain()  # a secret may have begun in earlier frames: process them without keeping them
        except BusUnavailable as failure:  # `take` raises the error
            self._failure = failure
        self._frames.clear()
        self._overflowed, self._lost_before = 0, self._bus.lost_frame_count()
        self.began_s = monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Stop listening; frames received by now can still be taken, even if the thread was late to read them."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        self._thread.join(1.0)
        try:
            if self._failure is None:
                self._bus.drain()
        except BusUnavailable as failure:  # `take` raises the error
            self._failure = failure
        finally:
            self._lost = self._bus.lost_frame_count() - self._lost_before
            self._untap()

    def _listen(self) -> None:
        try:
            while not self._stopping.is_set() and self._failure is None:
                self._bus.idle(TICK_S)
        except BaseException as failure:  # noqa: BLE001 - nobody sees what ends a thread: `take` raises it
            self._failure = failure
            self._arrived.set()

    def _keep(self, frame: Frame, _sent: bool) -> None:
        """Date and keep a frame; called by the thread that reads or sends, for every frame."""
        if frame.can_id in SDO_CAN_IDS:  # also for dropped frames: a transfer continues in the next frame
            frame, _ = self._secret.without(frame)
        if len(self._frames) >= self._most:
            self._overflowed += 1
            return
        self._frames.append(self._dated(frame))
        if not self._arrived.is_set():  # setting it again costs as much as the rest of this function
            self._arrived.set()

    def take(self, wait_s: float = 0.0) -> list[Frame]:
        """Frames since the last call; waits up to *wait_s* for the first frame.

        After a failure, raises its error once all earlier frames were taken: BusUnavailable for a
        failed bus.
        """
        if not self._frames and wait_s > 0 and self._failure is None:
            self._arrived.wait(wait_s)
        if self._frames and wait_s > 0 and self._failure is None:
            sleep(min(wait_s, GATHER_S))
        self._arrived.clear()
        count = len(self._frames)
        if not count and self._failure is not None:
            raise self._failure
        return [self._frames.popleft() for _ in range(count)]

    def _dated(self, frame: Frame) -> Frame:
        """*frame* with the time of day: some drivers count from their start, and a sent frame has no time.

        A time far from now, as from some gateways, is ignored: the frame came now.
        """
        now_s, sent_s = time(), frame.timestamp_s
        if not sent_s:
            return replace(frame, timestamp_s=now_s)
        if self._clock_s is None:
            ahead_s = now_s - sent_s
            self._clock_s = ahead_s if abs(ahead_s) > FOREIGN_CLOCK_S else 0.0
        dated_s = sent_s + self._clock_s
        if not -FOREIGN_CLOCK_S <= now_s - dated_s <= FOREIGN_CLOCK_S:  # also for NaN
            dated_s = now_s
        return frame if dated_s == sent_s else replace(frame, timestamp_s=dated_s)
