"""Whether the computer slept, as a laptop does whose lid is closed. Does not know buses."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

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
