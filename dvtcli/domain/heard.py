"""The last frame of each CAN-ID that was heard on a bus, and how regularly it comes.

Knows frames and times it is given. Does not know a clock, a bus, nor what a frame means.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

from dvtcli.domain.ports import Frame

#: CAN-IDs that are remembered; the one that was silent longest is forgotten for a new one.
MOST = 512


@dataclass(frozen=True, slots=True)
class Period:
    """Time between two frames of one CAN-ID in seconds: the last one, the shortest and the longest."""

    last_s: float
    least_s: float
    most_s: float


@dataclass(frozen=True, slots=True)
class Heard:
    """The last frame of a CAN-ID: its *data*, when it came (s, of the clock that `LastFrames.take` was given)."""

    data: bytes
    at_s: float
    #: None until a second frame came
    period: Period | None = None


class LastFrames:
    """Remembers the last data frame of each CAN-ID, at most `MOST` of them."""

    def __init__(self) -> None:
        self._heard: OrderedDict[tuple[int, bool], Heard] = OrderedDict()

    def take(self, frame: Frame, now_s: float) -> None:
        """Remember a *frame* that was heard at *now_s*; remote frames carry nothing to remember."""
        if frame.remote:
            return
        key = frame.can_id, frame.extended
        before = self._heard.pop(key, None)
        self._heard[key] = Heard(frame.data, now_s, None if before is None else _period(before, now_s))
        if len(self._heard) > MOST:
            self._heard.popitem(last=False)

    def clear(self) -> None:
        """Forget all of them."""
        self._heard.clear()

    def last(self, can_id: int, *, extended: bool = False) -> Heard | None:
        """What was last heard with *can_id* (11 bits, 29 where *extended*), None where nothing was."""
        return self._heard.get((can_id, extended))


def _period(before: Heard, now_s: float) -> Period:
    gap_s, known = now_s - before.at_s, before.period
    if known is None:
        return Period(gap_s, gap_s, gap_s)
    return Period(gap_s, min(known.least_s, gap_s), max(known.most_s, gap_s))
