"""Listening to a session's bus also where it goes and comes back. Does not know what the frames are for."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING

from dvtcli.errors import BusUnavailable
from dvtcli.operations.opening.first_bus import Tell
from dvtcli.operations.session.come_back import come_back, goes_on
from dvtcli.watch.listener import Listener

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus, Frame
    from dvtcli.operations.session.session import Session


#: what two clocks that are read one after the other may differ by (s)
_APART_S = 1.0


def asleep_s() -> float:
    """How long the computer slept since it was started, in seconds; 0 where no clock counts that (Linux's does)."""
    if sys.platform == "win32":
        return 0.0
    with_sleep: int | None = getattr(time, "CLOCK_BOOTTIME", None)
    if with_sleep is None:
        return 0.0
    return time.clock_gettime(with_sleep) - time.clock_gettime(time.CLOCK_MONOTONIC)


class Sleeps:
    """Tells of each sleep once, from now on; *clock* says how long it slept so far (s)."""

    def __init__(self, clock: Callable[[], float] = asleep_s) -> None:
        self._clock = clock
        self._known_s = clock()

    def new_s(self) -> float:
        """How long the computer slept since the last call, in seconds; 0 where it did not."""
        slept_s = self._clock() - self._known_s
        if slept_s < _APART_S:
            return 0.0
        self._known_s += slept_s
        return slept_s


class SteadyListener:
    """A `Listener` on the bus that *session* has open, and on the next one where that is gone, *unasked* or when asked.

    It listens inside of a `with`.
    """

    def __init__(self, session: Session, *, unasked: bool = False) -> None:
        self._session = session
        self._unasked = unasked
        self._sleeps = Sleeps()
        #: frames that were missed on the buses before this one: that did not fit here, and all
        self._before = 0, 0
        #: whether the bus was gone when the listening ended
        self.is_gone = False
        #: how long the bus was gone each time that it was (s)
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
        """Listen no longer; what came so far can still be taken."""
        self._listener.stop()

    @property
    def began_s(self) -> float:
        """Since when it listens to the bus that is open (of time.monotonic)."""
        return self._listener.began_s

    @property
    def overflowed(self) -> int:
        """Frames that came while too many waited to be taken."""
        return self._before[0] + self._listener.overflowed

    @property
    def dropped(self) -> int:
        """Frames that are missing, as far as anybody knows."""
        return self._before[1] + self._listener.dropped

    def tell_overflow(self) -> None:
        """Warn of frames that came while too many waited to be taken, if any did."""
        if self.overflowed:
            self._session.tell.warning(
                f"{self.overflowed} frames were dropped: they came faster than they were written"
            )

    def take(self, wait_s: float = 0.0) -> list[Frame]:
        """What came since the last call; waits up to *wait_s* (s) for the first one.

        Raises BusUnavailable where the bus failed, and where the computer slept and the bus would be waited for:
        nobody listened meanwhile.
        """
        slept_s = self._sleeps.new_s()
        if slept_s and goes_on(self._session, unasked=self._unasked):
            raise left_alone(self._bus.name, slept_s)
        return self._listener.take(wait_s)

    def come_back(self, failed: BusUnavailable, stopping: Callable[[], bool], tell: Tell | None = None) -> bool:
        """Wait for the bus, which *failed*, and listen to it again; False as soon as *stopping*().

        Raises *failed* where it is not to be waited for. What was not taken yet is lost.
        """
        if not goes_on(self._session, unasked=self._unasked):
            raise failed
        self.stop()
        self.is_gone = True
        gone_s = monotonic()
        try:
            if not come_back(self._session, self._bus, failed, stopping, tell):
                return False
        finally:
            self.gaps_s.append(monotonic() - gone_s)
        self._before = self.overflowed, self.dropped
        self._bus, self._listener = self._on_wire(after_gap=True)
        self._listener.__enter__()
        self.is_gone = False
        return True


def left_alone(name: str, slept_s: float) -> BusUnavailable:
    """What to say of the bus *name* after the computer slept for *slept_s* seconds, when nobody listened to it."""
    return BusUnavailable(f"{name} was left alone", why=f"this computer slept for {slept_s:.0f} s")
