"""A heartbeat that comes in time is not called lost, however late it is read; one that is missed is."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.gateway_words import GatewayError
from dvtcli.operations.gateway.gateway_work import LATE_S, Watch

STARTED, LOST = GatewayError.HEARTBEAT_STARTED, GatewayError.HEARTBEAT_LOST
#: how often a gateway reads the bus (s), which is also how late it hears
TURN_S = 0.021


def watch(within_s: float) -> Watch:
    return Watch(cast(Any, None), 4, within_s)


def read(came_s: list[float], *, has_stamps: bool) -> Iterator[tuple[float, list[tuple[float, float]]]]:
    """Each turn of a gateway: when it is, and the frames that it reads then, with the bus's time of each."""
    now_s, left = 0.0, list(came_s)
    while left or now_s < came_s[-1] + 10 * TURN_S:
        now_s += TURN_S
        here = [one for one in left if one <= now_s]
        left = left[len(here) :]
        yield now_s, [(1000.0 + one if has_stamps else 0.0, now_s) for one in here]


@given(st.integers(1, 100), st.integers(2, 200), st.booleans())
def test_a_regular_heartbeat_is_never_lost(every_ms: int, count: int, has_stamps: bool) -> None:
    one = watch(every_ms * 1.5 / 1000)
    came = [number * every_ms / 1000 for number in range(1, count)]
    for now_s, frames in read(came, has_stamps=has_stamps):
        for frame in frames:
            one.received(*frame)
        if now_s <= came[-1] + TURN_S:
            one.look(now_s)
    assert one.news == [STARTED]


@given(st.lists(st.floats(0.001, 0.5), min_size=2, max_size=40), st.floats(0.001, 0.3))
def test_by_the_times_of_the_bus_each_gap_is_told_and_no_other(gaps_s: list[float], within_s: float) -> None:
    one = watch(within_s)
    came = [1.0]
    for gap_s in gaps_s:
        came.append(came[-1] + gap_s)
    for now_s, frames in read(came, has_stamps=True):
        for frame in frames:
            one.received(*frame)
        one.look(now_s)
    expected = [STARTED]
    for before, after in pairwise(1000.0 + at for at in came):
        expected += [LOST, STARTED] if after - before > within_s else []
    if one.news[-1] is LOST:  # nothing comes any more
        expected.append(LOST)
    assert one.news == expected


def test_what_comes_no_more_is_lost_a_moment_after_its_time() -> None:
    one = watch(0.01)
    one.received(50.0, 1.0)
    one.look(1.009 + LATE_S)
    assert one.news == [STARTED]
    one.look(1.011 + LATE_S)
    assert one.news == [STARTED, LOST]
    one.look(9.0)
    assert one.news == [STARTED, LOST], "once"


@pytest.mark.parametrize("stamp_s", [float("nan"), 0.0, -5.0])
def test_a_clock_that_is_none_tells_no_loss(stamp_s: float) -> None:
    one = watch(0.01)
    for number in range(5):
        one.received(stamp_s, 1.0 + number / 100)
    one.received(2.0, 1.06)
    assert one.news == [STARTED]
