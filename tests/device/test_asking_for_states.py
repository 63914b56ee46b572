"""How a node's state and reasons are asked for, where it answers, keeps silent, or is heard only."""

from __future__ import annotations

import pytest

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.change.roll_back import PATIENCE_S, RETRY_S
from dvtcli.device.nmt_gate import CONFIRM_TIMEOUT_S, Gate, NodeAccess
from dvtcli.device.seen_state import why_it_may_move
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.errors import DeviceRefused, NoAnswer, SafetyRefusal, SdoAborted
from dvtcli.simulator.device.sdo_server import SdoServer
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, profile, silence
from tests.virtual_time import VirtualTimeBus


class Unheard(DirectBus):
    """A node without a heartbeat; each look at its state takes some time."""

    looks = 0

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        self.looks += 1
        self.slept_s += timeout_s
        return None


class Stubborn(DirectBus):
    """A node that is heard and never leaves OPERATIONAL."""

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        self.slept_s += min(timeout_s, 0.1)
        return NmtState.OPERATIONAL


class Silent(DirectSdo):
    """A device that answers nothing until the *until*-th question; then it does."""

    until = 0
    asked = 0

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        self.asked += 1
        if self.asked < self.until:
            raise silence(index, sub_index)
        return super().upload(index, sub_index)


def test_a_state_object_is_read_where_nothing_is_heard() -> None:
    device = booted("gen4")
    bus = Unheard(device, DirectSdo(device))
    access = NodeAccess(bus, NODE, profile("gen4"))
    assert access.state() is NmtState.PRE_OPERATIONAL
    assert access.confirmed(NmtState.PRE_OPERATIONAL, 1.0) is NmtState.PRE_OPERATIONAL
    assert bus.slept_s == 0
    assert access.confirmed(NmtState.STOPPED, 1.0) is None  # a stopped node answers nothing: it is only ever heard
    assert bus.slept_s >= 1.0


def test_without_a_state_object_a_state_is_only_heard() -> None:
    device = booted()
    bus = Unheard(device, DirectSdo(device))
    access = NodeAccess(bus, NODE, profile("generic"))
    assert access.state() is None
    assert access.confirmed(NmtState.PRE_OPERATIONAL, 1.0) is None
    assert (bus.slept_s >= 1.0, bus.channel.reads) == (True, [])  # type: ignore[attr-defined]


def test_a_node_that_says_another_state_has_so_long_to_change_it() -> None:
    device = booted()
    bus = Stubborn(device, DirectSdo(device))
    access = NodeAccess(bus, NODE, profile("generic"))
    assert access.confirmed(NmtState.PRE_OPERATIONAL, 1.0) is NmtState.OPERATIONAL
    before_s = bus.slept_s
    with pytest.raises(DeviceRefused, match="did not reach PRE-OPERATIONAL"):
        access.request(NmtState.PRE_OPERATIONAL)
    assert CONFIRM_TIMEOUT_S == 2.0
    assert bus.slept_s - before_s == pytest.approx(CONFIRM_TIMEOUT_S, abs=0.2)
    assert bus.commands == [NmtCommand.ENTER_PRE_OPERATIONAL]


def test_only_a_general_abort_has_a_reason_of_the_device_s_own() -> None:
    device = booted("gen4")
    bus = DirectBus.of(device)
    access = NodeAccess(bus, NODE, profile("gen4"))
    other = SdoAborted(0x1800, 1, 0x0609_0030, node=NODE)
    access.explain(other)
    assert (other.why, bus.channel.reads) == (None, [])  # type: ignore[attr-defined]
    general = SdoAborted(0x1800, 1, 0x0800_0000, node=NODE)
    NodeAccess(bus, NODE, profile("generic")).explain(general)
    assert (general.why, bus.channel.reads) == (None, [])  # type: ignore[attr-defined]
    access.explain(general)
    assert (general.why or "").startswith("the device says 0 at 0x5310:00: ")


def test_a_reason_that_cannot_be_read_is_said() -> None:
    device = booted("gen4")
    channel = Silent(device)
    channel.until = 99
    aborted = SdoAborted(0x1800, 1, 0x0800_0000, node=NODE)
    NodeAccess(DirectBus(device, channel), NODE, profile("gen4")).explain(aborted)
    assert aborted.why == "the device's reason at 0x5310:00 could not be read: silent"


def test_a_node_that_is_silent_is_asked_again_for_a_while() -> None:
    device = booted("gen4")
    channel = Silent(device)
    channel.until = 4
    bus = DirectBus(device, channel)
    NodeAccess(bus, NODE, profile("gen4")).insist(NmtState.OPERATIONAL)
    assert device.state is NmtState.OPERATIONAL
    assert bus.slept_s == pytest.approx(3 * RETRY_S)


def test_a_node_that_stays_silent_is_given_up() -> None:
    device = booted("gen4")
    channel = Silent(device)
    channel.until = 10_000
    bus = DirectBus(device, channel)
    with pytest.raises(NoAnswer):
        NodeAccess(bus, NODE, profile("gen4")).insist(NmtState.OPERATIONAL)
    assert bus.slept_s == pytest.approx(PATIENCE_S, abs=RETRY_S)


def test_the_gate_asks_goes_there_and_back_and_can_be_entered_again() -> None:
    bus = DirectBus.of(booted("gen4"))
    bus.device.nmt(NmtCommand.START)
    asked: list[str] = []
    gate = Gate(NodeAccess(bus, NODE, profile("gen4")), asked.append)
    for times in (1, 2):
        gate.enter()
        gate.enter()
        assert (len(asked), gate.entered, gate.found) == (times, True, NmtState.OPERATIONAL)
        assert bus.device.state is NmtState.PRE_OPERATIONAL
        gate.leave()
        assert (gate.entered, gate.found) == (False, None)
        assert bus.device.state is NmtState.OPERATIONAL
    gate.enter()
    assert gate.abandon() == "node 1 was OPERATIONAL and is PRE-OPERATIONAL now; when it is right: nmt start 1"
    assert (gate.entered, gate.found, bus.device.state) == (False, None, NmtState.PRE_OPERATIONAL)
    assert gate.abandon() is None


def test_the_gate_leaves_a_pre_operational_node_where_it_was() -> None:
    bus = DirectBus.of(booted("gen4"))
    gate = Gate(NodeAccess(bus, NODE, profile("gen4")), lambda _question: pytest.fail("asked for nothing"))
    gate.enter()
    gate.leave()
    assert (bus.commands, bus.device.state) == ([], NmtState.PRE_OPERATIONAL)


def test_a_stopped_node_is_not_worked_on() -> None:
    bus = DirectBus.of(booted("gen4"))
    bus.device.nmt(NmtCommand.STOP)
    with pytest.raises(SafetyRefusal, match="is STOPPED"):
        Gate(NodeAccess(bus, NODE, profile("gen4")), lambda _question: None).enter()


def test_a_cancellation_is_active_only_inside() -> None:
    cancellation = Cancellation()
    assert (cancellation.requested, cancellation.active, cancellation.exit_code) == (False, False, 130)

    def work() -> None:
        with cancellation.deferred():
            assert cancellation.active
            cancellation.requested = True
            raise KeyError

    with pytest.raises(KeyError):
        work()
    assert (cancellation.requested, cancellation.active) == (True, False)
    cancellation.active = True
    cancellation.reset()
    assert (cancellation.requested, cancellation.active) == (False, False)


class Lossy(SdoServer):
    """Loses its first answer, and counts what it was asked."""

    asked = 0

    def handle(self, request: bytes) -> bytes | None:
        self.asked += 1
        return None if self.asked == 1 else super().handle(request)


def enabled_drive() -> tuple[VirtualTimeBus, Lossy]:
    """A bus with a drive that says "operation enabled", and loses an answer."""
    drive = booted()
    drive.set_value(0x6041, 0, b"\x37\x12")
    bus = VirtualTimeBus([drive])
    bus.nodes[0].server = server = Lossy(drive)
    return bus, server


def test_one_lost_answer_does_not_make_a_drive_stand_still() -> None:
    bus, _ = enabled_drive()
    assert why_it_may_move(bus, NODE) == "has operation enabled (0x6041 is 0x1237)"


def test_a_node_that_is_heard_to_be_stopped_is_not_asked() -> None:
    bus, server = enabled_drive()
    bus.nodes[0].device.set_value(0x1017, 0, b"\x32\x00")
    bus.send_nmt(NmtCommand.STOP, NODE)
    bus.sleep(0.2)
    assert "STOPPED" in why_it_may_move(bus, NODE), "it is not known then"
    assert server.asked == 0
