"""The bus load of the toolbar, from frames at given times."""

from __future__ import annotations

import pytest

from dvtcli.domain.frame_bits import frame_bits
from dvtcli.domain.ports import Frame
from dvtcli.watch.statistics import BusLoad

FRAME = Frame(0x181, bytes(range(8)))


def test_the_load_is_the_bits_of_the_last_second() -> None:
    load = BusLoad(125_000)
    for number in range(100):
        load.add(FRAME, 10 + number / 100)
    bits = 100 * frame_bits(0x181, FRAME.data)
    assert load.share(11.0) == pytest.approx(bits / 125_000)
    assert load.share(11.5) == pytest.approx(bits / 125_000 / 2, rel=0.11)
    assert load.share(12.1) == 0


def test_an_idle_bus_and_one_that_falls_silent_have_no_load() -> None:
    load = BusLoad(500_000)
    assert load.share(5.0) == 0
    load.add(FRAME, 5.0)
    assert load.share(5.05) == 0
    assert load.share(5.15) > 0
    assert load.share(1000.0) == 0
