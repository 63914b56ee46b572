"""A reset is over with the boot-up that it brought, never with an older one."""

from __future__ import annotations

import pytest

from dvtcli.device.nmt_gate import Access
from dvtcli.device.store_parameters import await_power_cycle, reset_and_wait
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import NoAnswer
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
