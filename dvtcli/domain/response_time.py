"""Worst-case response times of frames on a CAN bus, and the share of the bus that they take."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import accumulate, groupby
from math import lcm
from typing import NamedTuple

from dvtcli.domain.frame_bits import arbitration, most_frame_bits

#: Maximum instances of a frame in a busy period; beyond it the frame counts as unbounded.
MOST_INSTANCES = 10_000
_US_A_SECOND = 1_000_000


class TimedFrame(NamedTuple):
    """A recurring frame, at most once per *period_us* (µs); None if unlimited.

    *jitter_us* is the maximum delay of its hand-over to the controller. *data_bytes* is 0..8.
    """

    can_id: int
    data_bytes: int
    period_us: Fraction | int | None
    jitter_us: Fraction | int = 0
    extended: bool = False
    remote: bool = False

    @property
    def bits(self) -> int:
        """Maximum bits on the wire, including 3 bits of interframe space."""
        return most_frame_bits(self.data_bytes, extended=self.extended, remote=self.remote)

    @property
    def arbitration(self) -> int:
        """Priority: the lower number wins."""
        return arbitration(self.can_id, extended=self.extended, remote=self.remote)


def response_times(frames: Sequence[TimedFrame], bit_rate: int, blocking_bits: int = 0) -> list[Fraction | None]:
    """The worst-case response time of each of *frames* in µs, in their order; None if unbounded.

    *bit_rate* is in bit/s. *blocking_bits* is the longest frame of lower priority than all of these, which may
    occupy the wire when a frame becomes ready. A response time is unbounded if the frame itself, or a frame of higher
    priority, is unlimited, or if they exceed the wire's capacity. The time includes the 3 bits after the frame.
    """
    found: list[Fraction | None] = [None] * len(frames)
    order = sorted(range(len(frames)), key=lambda number: frames[number].arbitration)
    longest_behind = _longest_behind([frames[number].bits for number in order], blocking_bits)
    wire = _Wire.of(frames, bit_rate)
    demand = _Demand()
    place = 0
    for _, group in groupby(order, key=lambda number: frames[number].arbitration):
        same = list(group)  # one priority: each waits for the others, and none of them blocks another
        place += len(same)
        loads = [wire.load(frames[number]) for number in same]
        if None in loads:
            break
        for load in filter(None, loads):
            demand.add(load)
        if demand.share > 1:
            break
        blocking = longest_behind[place] * wire.bit
        for number, load in zip(same, filter(None, loads), strict=True):
            units = demand.response(load, blocking, wire.bit)
            found[number] = None if units is None else Fraction(units, wire.unit)
    return found


def _longest_behind(bits: list[int], at_least: int) -> list[int]:
    """The largest of *bits* from each place on, and *at_least* behind the last."""
    return [*accumulate(reversed(bits), max, initial=at_least)][::-1]


def utilisation(frames: Iterable[TimedFrame], bit_rate: int) -> Fraction:
    """Maximum share (0 and up) of a wire at *bit_rate* bit/s for all *frames* with a period."""
    return sum((_rate(frame) * frame.bits for frame in frames), Fraction(0)) / bit_rate


def _rate(frame: TimedFrame) -> Fraction:
    """Frames per second; 0 for an unlimited frame, whose rate is unknown."""
    return Fraction(0) if frame.period_us is None else Fraction(_US_A_SECOND) / frame.period_us


class _Load(NamedTuple):
    """A frame's load: its *cost* per *period*, up to *jitter* late, all in units."""

    cost: int
    period: int
    jitter: int


class _Wire(NamedTuple):
    """The units in which times are whole numbers: units per µs (*unit*) and per bit (*bit*)."""

    unit: int
    bit: int

    @classmethod
    def of(cls, frames: Iterable[TimedFrame], bit_rate: int) -> _Wire:
        """The coarsest units in which the times of *frames*, and bits at *bit_rate* (bit/s), are whole."""
        given = (time for frame in frames for time in (frame.period_us, frame.jitter_us) if time is not None)
        finer = lcm(*{(Fraction(time) * bit_rate).denominator for time in given})
        return cls(bit_rate * finer, _US_A_SECOND * finer)

    def load(self, frame: TimedFrame) -> _Load | None:
        """The load of *frame*; None without a period."""
        if frame.period_us is None:
            return None
        return _Load(frame.bits * self.bit, int(frame.period_us * self.unit), int(frame.jitter_us * self.unit))


class _Demand:
    """Total demand of all added frames: *share* of the wire, and costs by period and jitter."""

    def __init__(self) -> None:
        self.share = Fraction(0)
        self._is_late = False
        self._costs: Counter[tuple[int, int]] = Counter()

    def add(self, load: _Load) -> None:
        """Add a frame; frames must be added by falling priority."""
        self.share += Fraction(load.cost, load.period)
        self._is_late = self._is_late or load.jitter > 0
        self._costs[load.period, load.jitter] += load.cost

    def response(self, own: _Load, blocking: int, bit: int) -> int | None:
        """The response time of *own*, already added, after all other added frames; None if unbounded."""
        if self.share == 1 and (blocking or self._is_late):
            return None
        loads = [(cost, period, jitter) for (period, jitter), cost in self._costs.items()]
        busy = _settled(own.cost, blocking, loads, 0)
        instances = -(-(busy + own.jitter) // own.period)
        if instances > MOST_INSTANCES:
            return None
        alike = (own.period, own.jitter)
        higher = [(cost - own.cost * ((period, jitter) == alike), period, jitter) for cost, period, jitter in loads]
        worst = begins = 0
        for instance in range(instances):
            before = blocking + instance * own.cost
            begins = _settled(max(begins, before), before, higher, bit)
            worst = max(worst, own.jitter + begins - instance * own.period + own.cost)
        return worst


def _settled(start: int, always: int, loads: list[tuple[int, int, int]], after: int) -> int:
    """The first time from *start* on that suffices for *always* and for all *loads* until *after* behind it.

    A load is cost, period and jitter: it adds its cost once per period begun.
    """
    time = start
    while True:
        needed = always
        for cost, period, jitter in loads:
            needed -= (time + after + jitter) // -period * cost
        if needed <= time:
            return time
        time = needed
