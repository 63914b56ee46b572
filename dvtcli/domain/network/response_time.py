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

from dvtcli.domain.bus_load import arbitration, most_frame_bits

#: A busy period with more instances of a frame than this is given up: its frame counts as one without a bound.
MOST_INSTANCES = 10_000
_US_A_SECOND = 1_000_000

#: Times are counted in units of 1/bit rate µs: a time in µs times the bit rate, or bits times 1,000,000. These are
#: whole numbers, unless somebody gives a period or a jitter that is none.
_Units = int | Fraction


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


@dataclass(frozen=True, slots=True)
class _Load:
    """What some frames ask of the wire: their *cost* each *period*, up to *jitter* late, all in units."""

    cost: _Units
    period: _Units
    jitter: _Units

    def within(self, time: _Units) -> _Units:
        """What they need of the wire in a time, its end excluded."""
        return -(-(time + self.jitter) // self.period) * self.cost


def response_times(frames: Sequence[TimedFrame], bit_rate: int, blocking_bits: int = 0) -> list[Fraction | None]:
    """The worst-case response time of each of *frames* in µs, in their order; None where there is no bound.

    *bit_rate* is in bit/s. *blocking_bits* is the longest of frames of lower priority than all of these, which may be
    on the wire just when one becomes ready. There is no bound where a frame itself, or one that goes before it, comes
    as often as it likes, or where these ask for more than the wire has. The time ends with the 3 bits after the frame.
    """
    order = sorted(range(len(frames)), key=lambda number: frames[number].arbitration)
    found: list[Fraction | None] = [None] * len(frames)
    for place, number in enumerate(order):
        own = frames[number]
        behind = next((at for at in range(place, len(order)) if frames[order[at]].arbitration > own.arbitration), None)
        others = [frames[one] for one in order[: len(order) if behind is None else behind] if one != number]
        lower = [] if behind is None else [frames[one].bits for one in order[behind:]]
        units = _response(own, others, max([blocking_bits, *lower]), bit_rate)
        found[number] = None if units is None else Fraction(units, bit_rate)
    return found


def utilisation(frames: Iterable[TimedFrame], bit_rate: int) -> Fraction:
    """The share of a wire of *bit_rate* bit/s, 0 and up, that *frames* with a period take at most."""
    return sum((_rate(one) * one.bits for one in frames), Fraction(0)) / bit_rate


def _rate(frame: TimedFrame) -> Fraction:
    """Frames a second; 0 for one without a period, whose rate nobody knows."""
    return Fraction(0) if frame.period_us is None else Fraction(_US_A_SECOND) / frame.period_us


def _response(own: TimedFrame, others: list[TimedFrame], blocking_bits: int, bit_rate: int) -> _Units | None:
    """The response time of *own* below *others*, which go first or have its priority."""
    limited = [_rate(one) for one in (own, *others) if one.period_us is not None]
    if len(limited) <= len(others):
        return None
    share = utilisation((own, *others), bit_rate)
    is_late = blocking_bits or own.jitter_us or any(one.jitter_us for one in others)
    if share > 1 or (share == 1 and is_late):
        return None
    higher, itself = _loads(others, bit_rate), _loads([own], bit_rate)[0]
    blocking = blocking_bits * _US_A_SECOND
    busy = _settled(itself.cost, blocking, [*higher, itself], 0)
    instances = -(-(busy + itself.jitter) // itself.period)
    if instances > MOST_INSTANCES:
        return None
    worst: _Units = 0
    begins: _Units = 0
    for instance in range(instances):
        before = blocking + instance * itself.cost
        begins = _settled(max(begins, before), before, higher, _US_A_SECOND)
        worst = max(worst, itself.jitter + begins - instance * itself.period + itself.cost)
    return worst


def _settled(start: _Units, always: _Units, loads: list[_Load], after: _Units) -> _Units:
    """The first time from *start* on that is enough for *always* and all that *loads* bring until *after* behind it."""
    time = start
    while True:
        needed = always + sum(one.within(time + after) for one in loads)
        if needed <= time:
            return time
        time = needed


def _loads(frames: list[TimedFrame], bit_rate: int) -> list[_Load]:
    """*frames*, all with a period, by period and jitter: those that have both in common count as one."""
    together: Counter[tuple[_Units, _Units]] = Counter()
    for one in frames:
        if one.period_us is not None:
            together[_units(one.period_us, bit_rate), _units(one.jitter_us, bit_rate)] += one.bits * _US_A_SECOND
    return [_Load(cost, period, jitter) for (period, jitter), cost in together.items()]


def _units(time_us: Fraction | int, bit_rate: int) -> _Units:
    units = Fraction(time_us) * bit_rate
    return units.numerator if units.denominator == 1 else units
