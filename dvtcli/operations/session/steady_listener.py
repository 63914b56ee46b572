"""Record a session's bus across its loss and return."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable
from dvtcli.operations.results.bus_events import BusEvent
from dvtcli.operations.session.bus_of_options import OnBusEvent, gone
from dvtcli.watch.listener import Listener

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes

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
    from dvtcli.bus.waiting import wait_for_bus

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
