"""Times as they are typed, in milliseconds."""

from __future__ import annotations

import pytest

from dvtcli.domain.times import milliseconds


@pytest.mark.parametrize(
    ("text", "time_ms"),
    [("20", 20), ("20ms", 20), ("20 ms", 20), ("0.02s", 20), (".5 s", 500), ("1e2", 100), ("0.1", 0.1), (" 7 ", 7)],
)
def test_a_time_is_said_with_its_unit_or_in_milliseconds(text: str, time_ms: float) -> None:
    assert milliseconds(text) == pytest.approx(time_ms)


@pytest.mark.parametrize("text", ["", "ms", "20 us", "1_0", "nan", "inf", "1,5", "٣", "20 m s", "0x14", "20ss"])
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is not a time in milliseconds, such as 20"):
        milliseconds(text)
