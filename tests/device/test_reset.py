"""A reset is over with the boot-up that it brought, never with an older one."""

from __future__ import annotations

import pytest

from dvtcli.device.nmt_gate import Access
from dvtcli.device.resets import await_power_cycle, reset_all_and_wait, reset_and_wait
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import Interrupted, NoAnswer
from tests.laws.bench import NODE, booted
from tests.virtual_time import VirtualTimeBus


def test_an_older_boot_up_is_not_the_reset_s() -> None:
    """A node that rules the network itself ignores the reset: its boot-ups of before confirm nothing."""
    master = booted("gen4")
    bus = VirtualTimeBus([master])
    access = Access(bus, NODE, GENERIC)
    reset_and_wait(access, NmtCommand.RESET_NODE)
    reset_and_wait(access, NmtCommand.RESET_NODE)
    seen = bus.boot_ups(NODE)
    assert seen >= 2
    assert master.family.master_object is not None
    master.set_value(*master.family.master_object, b"\1")
    with pytest.raises(NoAnswer, match="no boot-up message"):
        reset_and_wait(access, NmtCommand.RESET_NODE)
    assert bus.boot_ups(NODE) == seen


def test_an_older_boot_up_is_no_power_cycle() -> None:
    device = booted()
    bus = VirtualTimeBus([device])
    access = Access(bus, NODE, GENERIC)
    reset_and_wait(access, NmtCommand.RESET_NODE)
    with pytest.raises(NoAnswer, match="not switched off and on"):
        await_power_cycle(access, 30, lambda: None)

    def switch() -> None:
        device.restart()
        device.boot_up()

    await_power_cycle(access, 30, switch)
    assert bus.boot_ups(NODE) == 2


def test_the_seconds_of_a_reset_are_its_own() -> None:
    bus = VirtualTimeBus([booted()])
    bus.sleep(50)
    assert 0 <= reset_and_wait(Access(bus, NODE, GENERIC), NmtCommand.RESET_NODE) < 10


def test_whoever_stops_the_waiting_for_a_power_cycle_is_heard_and_it_ends_in_time() -> None:
    bus = VirtualTimeBus([booted()])
    access = Access(bus, NODE, GENERIC)

    def stop() -> None:
        raise Interrupted("enough")

    with pytest.raises(Interrupted):
        await_power_cycle(access, 30, lambda: None, stop)
    began_s = bus.now_s()
    with pytest.raises(NoAnswer, match=r"within 0\.05 s"):
        await_power_cycle(access, 0.05, lambda: None)
    assert bus.now_s() - began_s == pytest.approx(0.05)


def test_nodes_that_do_not_come_back_are_waited_for_together() -> None:
    bus = VirtualTimeBus([booted()])
    bus.sleep(5)
    began_s = bus.now_s()
    with pytest.raises(NoAnswer, match="from node 7, 9") as caught:
        reset_all_and_wait(bus, NmtCommand.RESET_NODE, (9, NODE, 7), 3)
    assert bus.now_s() - began_s == pytest.approx(3)
    assert caught.value.state == "unknown"
    reset_all_and_wait(bus, NmtCommand.RESET_NODE, (NODE,), 3)
