"""How long a CAN frame takes at worst from when it should be sent to its last bit: exact, in whole numbers.

The revised analysis of Davis, Burns, Bril and Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised" (Real-Time Systems 35, 2007), which looks at every instance in the busy period, with jitter.
Knows frames, priorities and times; not what a frame means, nor where its period comes from.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, groupby
from math import lcm

from dvtcli.domain.bus_load import arbitration, most_frame_bits

#: A busy period with more instances of a frame than this is given up: its frame counts as one without a bound.
MOST_INSTANCES = 10_000
_US_A_SECOND = 1_000_000


@dataclass(frozen=True, slots=True)
class TimedFrame:
    """A frame that comes again and again, at most once each *period_us* (µs); None where nothing limits it.

    *jitter_us* is how much later than its period says it may be handed to the controller. *data_bytes* is 0..8.
    """

    can_id: int
    data_bytes: int
    period_us: Fraction | int | None
    jitter_us: Fraction | int = 0
    extended: bool = False
    remote: bool = False

    @property
    def bits(self) -> int:
        """Its bits on the wire at most, with the 3 between two frames."""
        return most_frame_bits(self.data_bytes, extended=self.extended, remote=self.remote)

    @property
    def arbitration(self) -> int:
        """Who goes first: the lower number."""
        return arbitration(self.can_id, extended=self.extended, remote=self.remote)


def response_times(frames: Sequence[TimedFrame], bit_rate: int, blocking_bits: int = 0) -> list[Fraction | None]:
    """The worst-case response time of each of *frames* in µs, in their order; None where there is no bound.

    *bit_rate* is in bit/s. *blocking_bits* is the longest of frames of lower priority than all of these, which may be
    on the wire just when one becomes ready. There is no bound where a frame itself, or one that goes before it, comes
    as often as it likes, or where these ask for more than the wire has. The time ends with the 3 bits after the frame.
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
    """The share of a wire of *bit_rate* bit/s, 0 and up, that *frames* with a period take at most."""
    return sum((_rate(frame) * frame.bits for frame in frames), Fraction(0)) / bit_rate


def _rate(frame: TimedFrame) -> Fraction:
    """Frames a second; 0 for one without a period, whose rate nobody knows."""
    return Fraction(0) if frame.period_us is None else Fraction(_US_A_SECOND) / frame.period_us


@dataclass(frozen=True, slots=True)
class _Load:
    """What a frame asks of the wire: its *cost* each *period*, up to *jitter* late, all in units."""

    cost: int
    period: int
    jitter: int


@dataclass(frozen=True, slots=True)
class _Wire:
    """The units in which times are whole numbers: how many of them a µs has (*unit*), and a bit (*bit*)."""

    unit: int
    bit: int

    @classmethod
    def of(cls, frames: Iterable[TimedFrame], bit_rate: int) -> _Wire:
        """The coarsest units in which the times of *frames*, and bits at *bit_rate* (bit/s), are whole."""
        given = (time for frame in frames for time in (frame.period_us, frame.jitter_us) if time is not None)
        finer = lcm(*{(Fraction(time) * bit_rate).denominator for time in given})
        return cls(bit_rate * finer, _US_A_SECOND * finer)

    def load(self, frame: TimedFrame) -> _Load | None:
        """What *frame* asks of it; None without a period."""
        if frame.period_us is None:
            return None
        return _Load(frame.bits * self.bit, int(frame.period_us * self.unit), int(frame.jitter_us * self.unit))


class _Demand:
    """The demand of the frames that were added: their *share* of the wire, and their costs by period and jitter."""

    def __init__(self) -> None:
        self.share = Fraction(0)
        self._is_late = False
        self._costs: Counter[tuple[int, int]] = Counter()

    def add(self, load: _Load) -> None:
        """Add a frame that goes before all that will be added."""
        self.share += Fraction(load.cost, load.period)
        self._is_late = self._is_late or load.jitter > 0
        self._costs[load.period, load.jitter] += load.cost

    def response(self, own: _Load, blocking: int, bit: int) -> int | None:
        """The response time of *own*, one of those added, behind the others; None where it has no bound."""
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
    """The first time from *start* on that is enough for *always* and all that *loads* bring until *after* behind it.

    A load is cost, period and jitter: it brings its cost once each period begun.
    """
    time = start
    while True:
        needed = always
        for cost, period, jitter in loads:
            needed -= (time + after + jitter) // -period * cost
        if needed <= time:
            return time
        time = needed
