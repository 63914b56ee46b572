"""Times as text are those of `datetime`, to the last microsecond."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.domain.times import local_clock, utc

#: from the years that recordings may have; whole seconds, halves of a microsecond, what is rounded up to a whole second
times = st.one_of(st.floats(-1e10, 1e11), st.integers(-(10**10), 10**11), st.floats(0, 4e9))


@given(times)
@example(1764380000.9999999)
@example(-0.0000004)
@example(-5.25)
@example(0.0000005)
def test_utc_is_that_of_datetime(time_s: float) -> None:
    expected = datetime.fromtimestamp(time_s, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
    assert utc(time_s) == expected


@given(times, st.sampled_from(["seconds", "milliseconds", "microseconds"]))
@example(1764380000.9999999, "seconds")
@example(-0.0000004, "milliseconds")
def test_local_time_is_that_of_datetime(time_s: float, timespec: str) -> None:
    expected = datetime.fromtimestamp(time_s, UTC).astimezone().timetz().isoformat(timespec=timespec)
    assert local_clock(time_s, timespec) == expected


@pytest.mark.parametrize("time_s", [float("nan"), 1e13])
def test_what_is_no_time_is_refused(time_s: float) -> None:
    with pytest.raises((ValueError, OverflowError)):
        utc(time_s)
