"""Record a session's bus across its loss and return: a thread reads the bus and does nothing else. Sends nothing."""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import monotonic, sleep
from typing import TYPE_CHECKING, Protocol

from dvtcli.domain.ports import Frame
from dvtcli.domain.sdo_frame import SDO_CAN_IDS, SdoValues
from dvtcli.errors import BusUnavailable
from dvtcli.operations.results.frames import BusEvent
from dvtcli.operations.session.open_network import OnBusEvent, gone

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.session import Session, SessionNodes

#: maximum difference of two clocks read one after the other (s)
_APART_S = 1.0


def asleep_s() -> float:
    """Return the seconds for which the computer slept since boot; 0 if no clock counts them (Linux's does)."""
    if sys.platform == "win32":
        return 0.0
    with_sleep: int | None = getattr(time, "CLOCK_BOOTTIME", None)
    if with_sleep is None:
        return 0.0
    return time.clock_gettime(with_sleep) - time.clock_gettime(time.CLOCK_MONOTONIC)


class Sleeps:
    """Reports each sleep once, from now on; *clock* returns the seconds slept so far."""

    def __init__(self, clock: Callable[[], float] = asleep_s) -> None:
        self._clock = clock
        self._known_s = clock()

    def new_s(self) -> float:
        """Return the seconds slept since the last call; 0 if none."""
        slept_s = self._clock() - self._known_s
        if slept_s < _APART_S:
            return 0.0
        self._known_s += slept_s
        return slept_s


class SteadyListener:
    """A `Listener` on the session's bus, and on the reopened bus after a loss, *unasked* or on request.

    Records inside a `with`.
    """

    def __init__(self, session: Session, *, unasked: bool = False) -> None:
        self._session = session
        self._unasked = unasked
        self._sleeps = Sleeps()
        #: frames missed on earlier buses: by overflow, and in all
        self._before = 0, 0
        #: whether the bus was gone when the listening ended
        self.is_gone = False
        #: durations of the bus's losses (s)
        self.gaps_s: list[float] = []
        self._bus, self._listener = self._on_wire()

    def _on_wire(self, *, after_gap: bool = False) -> tuple[CanopenBus, Listener]:
        secret = self._session.secrets.in_frames(unknown=after_gap)  # how a transfer began nobody heard
        return self._session.wire, Listener(self._session.wire, secret)

    def __enter__(self) -> SteadyListener:
        self._listener.__enter__()
        return self

    def __exit__(self, *_exception: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Stop recording; received frames can still be taken."""
        self._listener.stop()

    @property
    def began_s(self) -> float:
        """Return the start of recording on the open bus (time.monotonic)."""
        return self._listener.began_s

    @property
    def overflowed(self) -> int:
        """Count frames lost by overflow of the queue."""
        return self._before[0] + self._listener.overflowed

    @property
    def dropped(self) -> int:
        """Count known missing frames."""
        return self._before[1] + self._listener.dropped

    def tell_overflow(self) -> None:
        """Warn of frames lost by overflow, if any."""
        if self.overflowed:
            self._session.reporter.warning(
                f"{self.overflowed} frames were dropped: they were received faster than they were written"
            )

    def take(self, wait_s: float = 0.0) -> list[Frame]:
        """Return the frames since the last call; waits up to *wait_s* (s) for the first frame.

        Raises BusUnavailable if the bus failed, and after a sleep of the computer if the bus is to be waited for:
        frames were missed.
        """
        slept_s = self._sleeps.new_s()
        if slept_s and goes_on(self._session, unasked=self._unasked):
            raise left_alone(self._bus.name, slept_s)
        return self._listener.take(wait_s)

    def come_back(
        self, failed: BusUnavailable, stopping: Callable[[], bool], on_bus_event: OnBusEvent | None = None
    ) -> bool:
        """Wait for the bus, which *failed*, and record again; False as soon as *stopping*().

        Raises *failed* if waiting is not allowed. Frames not taken yet are lost.
        """
        if not goes_on(self._session, unasked=self._unasked):
            raise failed
        self.stop()
        self.is_gone = True
        gone_s = monotonic()
        try:
            if not come_back(self._session, self._bus, failed, stopping, on_bus_event):
                return False
        finally:
            self.gaps_s.append(monotonic() - gone_s)
        self._before = self.overflowed, self.dropped
        self._bus, self._listener = self._on_wire(after_gap=True)
        self._listener.__enter__()
        self.is_gone = False
        return True


def left_alone(name: str, slept_s: float) -> BusUnavailable:
    """Make the error for the bus *name* after the computer slept *slept_s* seconds without recording."""
    return BusUnavailable(f"{name} was not read for a while", why=f"this computer slept for {slept_s:.0f} s")


def goes_on(session: SessionNodes, *, unasked: bool) -> bool:
    """Tell whether a lost bus is waited for: with --reconnect, or *unasked*; never with --no-reconnect.

    Simulated nodes of this process end with their bus.
    """
    options = session.options
    return (unasked or options.reconnect) and not options.no_reconnect and not session.wire.simulated


def come_back(
    session: Session,
    bus: CanopenBus,
    failed: BusUnavailable,
    stopping: Callable[[], bool],
    on_bus_event: OnBusEvent | None = None,
    between: Callable[[], AbstractContextManager[object]] = nullcontext,
) -> bool:
    """Wait until *bus*, which *failed*, can be reopened for the session; False as soon as *stopping*().

    *on_bus_event* gets loss and return. The session changes inside *between*() only, while nobody uses its nodes.
    Returns at once if somebody else reopened it.
    """
    on_bus_event = on_bus_event or session.reporter.bus
    began_s = monotonic()
    event = gone(bus.name, failed)
    on_bus_event(event)
    with between():
        if session.wire is not bus:
            return True
        session.leave_bus(event.text)
    from dvtcli.bus.opening import wait_for_bus

    opened = wait_for_bus(session.bus_again, stopping)
    if opened is None:
        return False
    with between():
        if stopping() or session.wire is not bus:  # by now nobody needs it
            opened.close()
            return not stopping()
        session.take_bus(opened)
    on_bus_event(BusEvent(opened.name, time.time(), after_s=monotonic() - began_s))
    return True


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
        now_s, sent_s = time.time(), frame.timestamp_s
        if not sent_s:
            return frame._replace(timestamp_s=now_s)
        if self._clock_s is None:
            ahead_s = now_s - sent_s
            self._clock_s = ahead_s if abs(ahead_s) > FOREIGN_CLOCK_S else 0.0
        dated_s = sent_s + self._clock_s
        if not -FOREIGN_CLOCK_S <= now_s - dated_s <= FOREIGN_CLOCK_S:  # also for NaN
            dated_s = now_s
        return frame if dated_s == sent_s else frame._replace(timestamp_s=dated_s)
