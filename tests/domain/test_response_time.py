"""Worst-case response times of frames: the tables of the analysis, its laws, and another implementation."""

from __future__ import annotations

import random
from collections.abc import Iterator
from fractions import Fraction

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.domain.response_time import TimedFrame, response_times, utilisation
from dvtcli.simulator.network.shared_bus import Wire
from tests.domain.critical_instant import by_hand
from tests.harness.sample import turn

_DATA_BYTES = [1, 2, 1, 2, 1, 2, 6, 1, 2, 2, 1, 4, 1, 1, 3, 1, 1]
_PERIODS_MS = [50, 5, 5, 5, 5, 5, 10, 10, 10, 10, 100, 100, 100, 100, 1000, 1000, 1000]


def _frames(data_bytes: list[int], periods_us: list[int]) -> list[TimedFrame]:
    """Frames in order of priority."""
    pairs = zip(data_bytes, periods_us, strict=True)
    return [TimedFrame(0x200 + number, size, period) for number, (size, period) in enumerate(pairs)]


_EXAMPLE = _frames(_DATA_BYTES, [1000 * period for period in _PERIODS_MS])


@pytest.mark.parametrize(
    ("frames", "bit_rate", "expected_ms"),
    [
        (_frames([7, 7, 7], [2500, 3500, 3500]), 125_000, "2.0 3.0 3.5"),
        (
            _EXAMPLE,
            125_000,
            "1.44 2.04 2.56 3.16 3.68 4.28 5.04 8.40 9.00 9.60 10.12 19.12 19.64 20.16 29.00 29.52 29.52",
        ),
        (
            _EXAMPLE,
            250_000,
            "0.72 1.02 1.28 1.58 1.84 2.14 2.52 2.78 3.08 3.38 3.64 3.98 4.24 4.50 4.76 5.02 5.02",
        ),
    ],
    ids=["three frames, where older analyses say 3.0", "17 frames at 125 kbit/s", "17 frames at 250 kbit/s"],
)
def test_the_tables(frames: list[TimedFrame], bit_rate: int, expected_ms: str) -> None:
    found = response_times(frames, bit_rate)
    assert found == [Fraction(time) * 1000 for time in expected_ms.split()]


def test_priorities_are_the_wires() -> None:
    """A data frame goes before a remote one, an 11-bit CAN-ID before the 29-bit one that begins with it."""
    runners = [
        TimedFrame(0x100, 8, 10_000),
        TimedFrame(0x100, 0, 10_000, remote=True),
        TimedFrame(0x100 << 18, 8, 10_000, extended=True),
        TimedFrame(0x101, 8, 10_000),
    ]
    numbers = [one.arbitration for one in runners]
    assert numbers == sorted(set(numbers))
    assert [one.bits for one in runners] == [135, 55, 160, 135]


def test_what_nothing_limits_has_no_bound_and_gives_none_to_what_comes_behind_it() -> None:
    frames = [TimedFrame(0x100, 8, 10_000), TimedFrame(0x200, 8, None), TimedFrame(0x300, 8, 10_000)]
    assert response_times(frames, 500_000) == [540, None, None]
    assert utilisation(frames, 500_000) == Fraction(2 * 135, 5000)


def test_more_than_the_wire_has_is_no_bound() -> None:
    crowd = [TimedFrame(number, 8, 1000) for number in range(0x200, 0x204)]
    assert response_times(crowd, 500_000)[:3] == [540, 810, 1080]
    assert response_times(crowd, 500_000)[3] is None
    assert utilisation(crowd, 500_000) == Fraction(108, 100)


def test_a_wire_that_is_just_full() -> None:
    """Nothing waits for ever while nothing is late: with a blocking frame, or with jitter, something would."""
    full = [TimedFrame(0x200 + number, 7, 2000) for number in range(2)]
    assert response_times(full, 125_000) == [2000, 2000]
    assert response_times(full, 125_000, blocking_bits=1)[1] is None


def test_frames_of_one_priority_wait_for_each_other() -> None:
    twins = [TimedFrame(0x200, 8, 10_000), TimedFrame(0x200, 0, 10_000)]
    assert response_times(twins, 1_000_000) == [190, 190]


def _set_of_frames(choice: random.Random) -> list[TimedFrame]:
    """Frames that ask for 10 to 99 % of a wire of 125 kbit/s, some of them with jitter."""
    while True:
        count = choice.randint(1, 8)
        periods = [choice.choice([1000, 2500, 3500, 5000, 7000, 10_000, 20_000, 33_300]) for _ in range(count)]
        frames = [
            TimedFrame(
                choice.randrange(0x800), choice.randint(0, 8), period,
                choice.choice([0, 0, period // 7, period // 2, 2 * period]), extended=choice.random() < 0.2,
            )
            for period in periods
        ]  # fmt: skip
        if len({one.arbitration for one in frames}) == count and utilisation(frames, 125_000) < Fraction(99, 100):
            return frames


def _choices(config: pytest.Config, part: int = 1) -> Iterator[random.Random]:
    """A choice for each of `--frame-sets` sets, or for one of *part* of them; the same again for the same seed."""
    for number in range(-(-config.getoption("--frame-sets") // part)):
        yield random.Random(f"{turn(config)} {number}")


@pytest.mark.counted
def test_another_implementation_agrees(pytestconfig: pytest.Config) -> None:
    """One that was written apart, which sends frame by frame from the critical instant on, in fractions of a second."""
    for choice in _choices(pytestconfig):
        frames = _set_of_frames(choice)
        blocking = choice.choice([0, 0, 55, 135])
        expected = by_hand(
            [(one.arbitration, one.bits, one.period_us, one.jitter_us) for one in frames], 125_000, blocking
        )
        assert response_times(frames, 125_000, blocking) == expected, frames


@pytest.mark.counted
def test_a_longer_frame_or_more_jitter_never_makes_a_response_shorter(pytestconfig: pytest.Config) -> None:
    for choice in _choices(pytestconfig, 5):
        frames = _set_of_frames(choice)
        changed = list(frames)
        number = choice.randrange(len(frames))
        one = frames[number]
        changed[number] = TimedFrame(
            one.can_id, min(8, one.data_bytes + choice.randint(0, 2)), one.period_us,
            one.jitter_us + choice.choice([0, 100, 1000]), extended=one.extended,
        )  # fmt: skip
        for before, after in zip(response_times(frames, 125_000), response_times(changed, 125_000), strict=True):
            assert after is None or (before is not None and after >= before), frames


@pytest.mark.counted
def test_no_frame_on_the_wire_takes_longer(pytestconfig: pytest.Config) -> None:
    """Frames with any data, from any start, late by up to their jitter, on the wire that simulated buses have."""
    for choice in _choices(pytestconfig, 10):
        frames = _set_of_frames(choice)
        bounds = response_times(frames, 125_000)
        for number, seen_us in _seen_on_a_wire(frames, choice).items():
            bound = bounds[number]
            assert bound is None or seen_us <= float(bound) + 0.01, frames


def _seen_on_a_wire(frames: list[TimedFrame], choice: random.Random) -> dict[int, float]:
    """The longest time in µs that each of *frames* took within a quarter of a second."""
    wire = Wire(125_000)
    nominal: dict[int, list[float]] = {number: [] for number in range(len(frames))}
    alike = choice.random() < 0.5
    for number, one in enumerate(frames):
        assert one.period_us is not None
        period_s, jitter_s = float(one.period_us) / 1e6, float(one.jitter_us) / 1e6
        should_s = 0.0 if alike else choice.random() * period_s
        last_s = 0.0
        while should_s < 0.25:
            late_s = jitter_s * (choice.random() if should_s > jitter_s else float(alike))
            last_s = max(last_s, should_s + late_s)
            data = bytes(one.data_bytes) if alike else choice.randbytes(one.data_bytes)
            nominal[number].append(should_s)
            wire.offer(number, Frame(one.can_id, data, one.extended), last_s)
            should_s += period_s
    worst: dict[int, float] = {}
    now_s: float | None = 0.0
    while now_s is not None:
        while arrived := wire.take(now_s):
            at_s, source, _ = arrived
            assert isinstance(source, int)
            worst[source] = max(worst.get(source, 0.0), 1e6 * (at_s - nominal[source].pop(0)))
        now_s = wire.next_s()
    return worst
