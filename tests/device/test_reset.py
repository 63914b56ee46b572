"""A reset is over with the boot-up that it brought, never with an older one."""

from __future__ import annotations

import pytest

from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.device.resets import (
    BOOT_TIMEOUT_S,
    QUIET_S,
    await_power_cycle,
    reset_all_and_wait,
    reset_and_wait,
    send_reset,
)
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import Interrupted, NoAnswer
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.laws.bench import NODE, booted, dictionary
from tests.virtual_time import ANSWER_S, VirtualTimeBus


class WithoutSdo(VirtualTimeBus):
    """No SDO answer arrives here."""

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        if frame.can_id != 0x580 + NODE:
            super()._to_us(frame, delay_s)


def test_an_older_boot_up_is_not_the_reset_s() -> None:
    """A node that rules the network itself ignores the reset: its boot-ups of before confirm nothing."""
    master = booted("gen4")
    bus = VirtualTimeBus([master])
    access = NodeAccess(bus, NODE, GENERIC)
    reset_and_wait(access, NmtCommand.RESET_NODE)
    reset_and_wait(access, NmtCommand.RESET_NODE)
    seen = bus.boot_ups(NODE)
    assert seen >= 2
    assert master.family.master_object is not None
    master.set_value(*master.family.master_object, b"\1")
    sent = send_reset(access, NmtCommand.RESET_NODE)
    assert sent.wait() >= QUIET_S, "it answers, as it would have at once"
    assert not sent.booted
    assert bus.boot_ups(NODE) == seen


@pytest.mark.parametrize("polled", [False, True])
def test_any_answer_ends_the_wait_for_a_node_that_sends_no_boot_up_message(polled: bool) -> None:
    bus = VirtualTimeBus([booted("no-boot-up")])
    sent = send_reset(NodeAccess(bus, NODE, GENERIC), NmtCommand.RESET_NODE)
    if polled:
        while not sent.is_over():
            bus.sleep(0.1)
    else:
        sent.wait()
    assert QUIET_S <= bus.now_s() - sent.began_s <= QUIET_S + 1
    assert not sent.booted


@pytest.mark.parametrize("heartbeat_ms", [0, 100])
def test_a_node_that_answers_nothing_is_waited_for_to_the_end(heartbeat_ms: int) -> None:
    """Heartbeats alone do not end it: what the node holds cannot be read."""
    device = booted("no-boot-up")
    device.set_value(0x1017, 0, heartbeat_ms.to_bytes(2, "little"))
    bus = WithoutSdo([device])
    sent = send_reset(NodeAccess(bus, NODE, GENERIC), NmtCommand.RESET_NODE)
    with pytest.raises(NoAnswer, match="neither a boot-up message nor an answer within 10 s after its reset") as caught:
        sent.wait()
    assert caught.value.state == "unknown"
    assert bus.now_s() - sent.began_s == pytest.approx(BOOT_TIMEOUT_S, abs=0.2)


def test_of_all_that_are_reset_those_without_a_boot_up_message_are_named() -> None:
    nodes = [
        StrictDevice(dictionary("generic"), load_family(family), node_id)
        for node_id, family in enumerate(("generic", "no-boot-up", "no-boot-up"), 1)
    ]
    bus = VirtualTimeBus(nodes)
    began_s = bus.now_s()
    assert reset_all_and_wait(bus, NmtCommand.RESET_NODE, (1, 2, 3)) == [2, 3]
    assert bus.now_s() - began_s <= QUIET_S + 2


def test_an_older_boot_up_is_no_power_cycle() -> None:
    device = booted()
    bus = VirtualTimeBus([device])
    access = NodeAccess(bus, NODE, GENERIC)
    reset_and_wait(access, NmtCommand.RESET_NODE)
    with pytest.raises(NoAnswer, match="not switched off and on"):
        await_power_cycle(access, 30, lambda: None)

    def switch() -> None:
        device.restart()
        device.boot_up()

    await_power_cycle(access, 30, switch)
    assert bus.boot_ups(NODE) == 2


class SwitchedOff(VirtualTimeBus):
    """A bus whose node answers nothing for the seconds *off*, and loses no other frame."""

    off = (0.0, 0.0)

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        if not self.off[0] <= self.now_s() < self.off[1]:
            super()._to_us(frame, delay_s)


def test_a_node_without_boot_up_message_is_back_from_a_power_cycle_with_any_answer() -> None:
    bus = SwitchedOff([booted("no-boot-up")])
    bus.off = (5.0, 9.0)
    await_power_cycle(NodeAccess(bus, NODE, GENERIC), 30, lambda: None)
    assert 9.0 <= bus.now_s() < 10.0


def test_a_lost_answer_is_no_power_cycle() -> None:
    bus = SwitchedOff([booted("no-boot-up")])
    bus.off = (5.0, 5.15)
    with pytest.raises(NoAnswer, match=r"not switched off and on: no boot-up message within 20 s$"):
        await_power_cycle(NodeAccess(bus, NODE, GENERIC), 20, lambda: None)


def test_a_node_that_stays_off_is_said_to_answer_nothing() -> None:
    bus = SwitchedOff([booted()])
    bus.off = (5.0, 99.0)
    with pytest.raises(NoAnswer, match="within 20 s, and it answers no SDO"):
        await_power_cycle(NodeAccess(bus, NODE, GENERIC), 20, lambda: None)


def test_the_seconds_of_a_reset_are_its_own() -> None:
    bus = VirtualTimeBus([booted()])
    bus.sleep(50)
    assert 0 <= reset_and_wait(NodeAccess(bus, NODE, GENERIC), NmtCommand.RESET_NODE) < 10


def test_whoever_stops_the_waiting_for_a_power_cycle_is_heard_and_it_ends_in_time() -> None:
    bus = VirtualTimeBus([booted()])
    access = NodeAccess(bus, NODE, GENERIC)

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
    with pytest.raises(NoAnswer, match="from nodes 7 and 9") as caught:
        reset_all_and_wait(bus, NmtCommand.RESET_NODE, (9, NODE, 7), 3)
    assert bus.now_s() - began_s == pytest.approx(3)
    assert caught.value.state == "unknown"
    reset_all_and_wait(bus, NmtCommand.RESET_NODE, (NODE,), 3)
