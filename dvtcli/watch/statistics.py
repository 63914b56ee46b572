"""Statistics of a frame, its values and a watched object: rate, jitter, minimum and maximum, and recent history. Pure.

Times are in seconds.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, isfinite, log2
from statistics import fmean, pstdev
from typing import NamedTuple

from dvtcli.domain.datatypes import Value
from dvtcli.domain.frame_bits import frame_bits
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.watch.decoder import Signal

#: Window of the statistics (s), and its number of slots.
WINDOW_S, SLOTS = 1.0, 10
#: A load (0..1) above which messages of low priority wait long.
HIGH_LOAD = 0.7


class BusLoad:
    """The load of a bus of *bitrate* bit/s (None: unknown); thread-safe for one writer and one reader."""

    def __init__(self, bitrate: int | None) -> None:
        self._bitrate = bitrate
        #: by slot of time, the newest last: (number of the slot, frames, bits)
        self._slots: deque[tuple[int, int, int]] = deque(maxlen=SLOTS + 1)

    def add(self, frame: Frame, now_s: float) -> None:
        """Count *frame*, received at *now_s*."""
        slot = int(now_s * SLOTS / WINDOW_S)
        bits = 0 if self._bitrate is None else frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)
        if self._slots and self._slots[-1][0] == slot:
            _, frames, before = self._slots[-1]
            self._slots[-1] = slot, frames + 1, before + bits
        else:
            self._slots.append((slot, 1, bits))

    def share(self, now_s: float) -> float | None:
        """Bus load (0..1) in the last whole slots; None without a bit rate."""
        if self._bitrate is None:
            return None
        return sum(bits for _, bits in self._lately(now_s)) / (self._bitrate * WINDOW_S)

    def frames_a_second(self, now_s: float) -> float:
        """Frames per second in the last whole slots."""
        return sum(frames for frames, _ in self._lately(now_s)) / WINDOW_S

    def _lately(self, now_s: float) -> list[tuple[int, int]]:
        now = int(now_s * SLOTS / WINDOW_S)
        return [(frames, bits) for slot, frames, bits in tuple(self._slots) if now - SLOTS <= slot < now]


#: number of frames for rate and jitter
LATELY = 64
#: a frame is overdue after this many of its mean periods, and at least this long (s)
PERIODS, GRACE_S = 4, 1.0
#: duration of a point (s), and number of kept points: 60 s
POINT_S, POINTS = 0.1, 600
#: a graph's span counts as at least so long (s): all its values may have one time
SHORTEST_S = 1e-9


class FrameIntervals:
    """When a frame came lately."""

    __slots__ = ("times_s",)

    def __init__(self) -> None:
        self.times_s: deque[float] = deque(maxlen=LATELY)

    def beat(self, time_s: float) -> None:
        """The frame came at *time_s*."""
        self.times_s.append(time_s)

    def gaps(self) -> list[float]:
        """Return the times between the last frames (s)."""
        return [later - before for before, later in pairwise(self.times_s)]

    def rate_hz(self, now_s: float) -> float | None:
        """Frames per second: 0 if the frame is overdue at *now_s*, None if too few frames came."""
        gaps = self.gaps()
        if not gaps:
            return None
        mean_s = fmean(gaps)
        if now_s - self.times_s[-1] > max(PERIODS * mean_s, GRACE_S):
            return 0.0
        return 1 / mean_s if mean_s > 0 else None

    def jitter_s(self) -> float | None:
        """Standard deviation of the time between frames, in seconds; None if too few frames came."""
        gaps = self.gaps()
        return pstdev(gaps) if len(gaps) >= 2 else None


class Point(NamedTuple):
    """Range of a value within a `POINT_S`, beginning at *time_s*."""

    time_s: float
    low: float
    high: float
    last: float


def physical_points(points: Iterable[Point], meaning: Scaling) -> list[Point]:
    """*points* of raw values in their physical unit."""
    if not meaning.is_scaled:
        return list(points)
    factor, offset = float(meaning.factor), float(meaning.offset)

    def scaled(point: Point) -> Point:
        low, high = sorted((point.low * factor + offset, point.high * factor + offset))
        return Point(point.time_s, low, high, point.last * factor + offset)

    return [scaled(point) for point in points]


class ValueHistory:
    """History of a signal: present value, minimum and maximum, and the last minute as points."""

    __slots__ = ("changed_s", "high", "last", "low", "points")

    def __init__(self) -> None:
        self.last: Value | None = None
        self.changed_s = float("-inf")
        self.points: deque[Point] = deque(maxlen=POINTS)
        self.low: float | None = None
        self.high: float | None = None

    def take(self, value: Value, time_s: float) -> bool:
        """Add *value* at *time_s*; whether it differs from the previous value."""
        changed = value != self.last
        if changed:
            self.last, self.changed_s = value, time_s
        if isinstance(value, int | float) and isfinite(value):
            self._count(value, time_s)
        return changed

    def _count(self, number: float, time_s: float) -> None:
        self.low = number if self.low is None else min(self.low, number)
        self.high = number if self.high is None else max(self.high, number)
        start_s = time_s // POINT_S * POINT_S
        points = self.points
        if points and points[-1].time_s >= start_s:
            point = points[-1]
            points[-1] = Point(point.time_s, min(point.low, number), max(point.high, number), number)
        else:
            points.append(Point(start_s, number, number, number))

    def forget(self) -> None:
        """Reset minimum, maximum and points; the value stays."""
        self.low = self.high = None
        self.points.clear()


def spark(values: Sequence[float], levels: str) -> str:
    """*values* as characters, from the first of *levels* (minimum) to the last (maximum)."""
    if not values:
        return ""
    low, span = min(values), max(values) - min(values)
    if not span or not isfinite(span):
        return levels[0] * len(values)
    top = len(levels) - 1
    return "".join(levels[round((value - low) / span * top)] for value in values)


#: histogram steps per doubling: results are at most 9 % too high
_STEPS = 8
_FLOOR_S = 1e-6


@dataclass(slots=True)
class Lateness:
    """Statistics of delays, as a histogram."""

    #: maximum, None without delays
    most_s: float | None = None
    _often: Counter[int] = field(default_factory=Counter)

    def add(self, late_s: float) -> None:
        """Add a delay of *late_s* seconds; early counts as in time."""
        late_s = max(late_s, 0.0)
        self.most_s = max(self.most_s or 0.0, late_s)
        self._often[ceil(_STEPS * log2(max(late_s, _FLOOR_S) / _FLOOR_S))] += 1

    def nearly_all_s(self) -> float | None:
        """The 99 % quantile in seconds; None without delays."""
        if self.most_s is None:
            return None
        left = 0.99 * self._often.total()
        for step, often in sorted(self._often.items()):
            left -= often
            if left <= 0:
                return min(_FLOOR_S * 2 ** (step / _STEPS), self.most_s)
        return self.most_s


#: A CAN-ID, and whether it has 29 bits.
Identifier = tuple[int, bool]


@dataclass(slots=True)
class Counted:
    """Frames of a CAN-ID: number, *bits* with real stuff bits, and the times between frames.

    *data_bytes* is the length of the longest frame, *shortest_s* and *longest_s* are between two consecutive frames,
    None if fewer than two had a time.
    """

    frames: int = 0
    bits: int = 0
    data_bytes: int = 0
    shortest_s: float | None = None
    longest_s: float | None = None
    _last_s: float = 0.0

    def add(self, frame: Frame) -> None:
        """Count *frame*."""
        self.frames += 1
        self.bits += frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)
        self.data_bytes = max(self.data_bytes, len(frame.data))
        if not frame.timestamp_s:
            return  # sent from here: its time on the wire is unknown
        if self._last_s:
            gap_s = frame.timestamp_s - self._last_s
            self.shortest_s = gap_s if self.shortest_s is None else min(self.shortest_s, gap_s)
            self.longest_s = gap_s if self.longest_s is None else max(self.longest_s, gap_s)
        self._last_s = frame.timestamp_s


@dataclass(slots=True)
class FrameCount:
    """Frames by CAN-ID."""

    by_id: dict[Identifier, Counted] = field(default_factory=dict)

    def add(self, frame: Frame) -> None:
        """Count *frame*."""
        self.by_id.setdefault((frame.can_id, frame.extended), Counted()).add(frame)

    @property
    def frames(self) -> int:
        """Total number of frames."""
        return sum(count.frames for count in self.by_id.values())

    @property
    def bits(self) -> int:
        """How many bits they took in all."""
        return sum(count.bits for count in self.by_id.values())


@dataclass(slots=True)
class WatchedObject:
    """The object *signal* of *node*; *problem* is the error of the last read, empty for none.

    *read_s* is the time of the last successful read (s since 1970), None for none.
    """

    node: int
    signal: Signal
    history: ValueHistory = field(default_factory=ValueHistory)
    read_s: float | None = None
    problem: str = ""

    def take(self, signal: Signal, value: Value, time_s: float) -> None:
        """Note *value* at *time_s*; *signal* is its description."""
        self.signal, self.read_s, self.problem = signal, time_s, ""
        self.history.take(value, time_s)

    def fail(self, problem: str) -> None:
        """Note a failed read with *problem*; the last value stays."""
        self.problem = problem
