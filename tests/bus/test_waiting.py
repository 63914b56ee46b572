"""Waiting for a bus: how often it is tried, what ends the waiting, and a computer that slept."""

from __future__ import annotations

import pytest

from dvtcli.bus.opening import open_bus, wait_for_bus
from dvtcli.errors import BusUnavailable
from dvtcli.operations.session.steady_listener import Sleeps, asleep_s


def test_it_is_tried_until_it_opens() -> None:
    tries = 0

    def open_once() -> str:
        nonlocal tries
        tries += 1
        if tries < 3:
            raise BusUnavailable("not yet")
        return "the bus"

    assert wait_for_bus(open_once, lambda: False) == "the bus"
    assert tries == 3


def test_nobody_tries_who_wants_to_stop() -> None:
    def open_once() -> str:
        raise AssertionError("it was tried")

    assert wait_for_bus(open_once, lambda: True) is None


def test_a_fault_is_no_bus_that_is_not_there() -> None:
    def open_once() -> str:
        raise ValueError("a fault")

    with pytest.raises(ValueError, match="a fault"):
        wait_for_bus(open_once, lambda: False)


@pytest.mark.parametrize(
    ("interface", "extra", "may_come"),
    [
        ("socketcand", {"host": "127.0.0.1", "port": "1"}, True),
        ("slcan", {"sleep_after_open": "0"}, True),
        ("no-such-driver", {}, False),
        ("socketcand", {}, False),
    ],
)
def test_what_can_never_open_is_told_from_what_may(interface: str, extra: dict[str, str], may_come: bool) -> None:
    if interface == "slcan":
        pytest.importorskip("serial")
    with pytest.raises(BusUnavailable) as caught:
        open_bus(interface, "/dev/no-such-port", extra=extra)
    assert caught.value.may_come is may_come


def test_each_sleep_is_told_once() -> None:
    slept_s = 100.0
    sleeps = Sleeps(lambda: slept_s)
    assert sleeps.new_s() == 0
    slept_s += 0.5
    assert sleeps.new_s() == 0, "two clocks are not read at once"
    slept_s += 30
    assert sleeps.new_s() == 30.5
    assert sleeps.new_s() == 0
    assert abs(asleep_s() - asleep_s()) < 1
