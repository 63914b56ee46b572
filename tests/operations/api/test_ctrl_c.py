"""Ctrl-C during a call: the change is put back, and the program gets its KeyboardInterrupt."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

import dvtcli
from dvtcli.results import Progress


@pytest.fixture(autouse=True)
def pythons_own_handler() -> Iterator[None]:
    """A worker of a parallel run has none."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def press(progress: Progress) -> None:
    if progress.done == 3:
        os.kill(os.getpid(), signal.SIGINT)


def test_it_waits_for_a_safe_point_and_puts_the_change_back() -> None:
    with dvtcli.simulate("gen4", on_progress=press) as bus:
        node = bus.node()
        before = node.pdo("tpdo1").config
        with pytest.raises(KeyboardInterrupt, match="stopped after step 3 of 7; the device: rolled_back"):
            node.map("tpdo1", "6041", "606C", event=True, timer_ms=100)
        assert node.pdo("tpdo1").config == before
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        node.set("tpdo2", event=True, timer_ms=500)
        assert node.verify()


def test_a_programs_own_handler_stays() -> None:
    pressed: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _frame: pressed.append(number))
    with dvtcli.simulate("gen4", on_progress=press) as bus:
        bus.node().map("tpdo1", "6041", "606C", event=True, timer_ms=100)
        assert bus.node().verify()
    assert pressed == [signal.SIGINT]
