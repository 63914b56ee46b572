"""Getting a device where PDOs can be written: its state, on its own terms, and raw writes of what nobody may see."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from dvtcli.device.access_level import log_in
from dvtcli.device.nmt_gate import Gate, NodeAccess
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.errors import DeviceRefused, SdoAborted, SdoProtocolError
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.device.test_reading_and_storing import Table
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, profile


def driven(*, master: bool, family: str = "gen4") -> tuple[NodeAccess, DirectBus]:
    """A vehicle that is being driven: it stays OPERATIONAL whatever it is asked."""
    behaviour = load_family(family)._replace(stays_operational=True)
    device = StrictDevice(dictionary("gen4"), behaviour, NODE)
    device.boot_up()
    device.take_outbox()
    device.nmt(NmtCommand.START)
    device.set_value(0x5800, 0, bytes([master]))
    bus = DirectBus.of(device)
    return NodeAccess(bus, NODE, profile("gen4")), bus


@pytest.mark.parametrize("master", [True, False])
def test_a_vehicle_that_is_driven_refuses_and_nothing_is_written(master: bool) -> None:
    access, bus = driven(master=master)
    with pytest.raises(DeviceRefused) as caught:
        Gate(access, lambda _question: None).enter()
    assert caught.value.text == "node 1 did not reach PRE-OPERATIONAL"
    assert "it says OPERATIONAL" in (caught.value.why or "")
    assert bus.device.state is NmtState.OPERATIONAL
    assert isinstance(bus.channel, DirectSdo)
    assert {index for index, _, _ in bus.channel.writes} <= {0x2800}


def test_a_master_s_request_is_taken_back_since_it_outlasts_the_power() -> None:
    access, bus = driven(master=True)
    with pytest.raises(DeviceRefused):
        access.request(NmtState.PRE_OPERATIONAL)
    assert isinstance(bus.channel, DirectSdo)
    assert bus.channel.writes == [(0x2800, 0, b"\1"), (0x2800, 0, b"\0")]
    assert bus.device.value(0x2800) == b"\0"


def test_a_master_that_nobody_is_logged_in_to_says_why_it_refuses() -> None:
    access, _ = driven(master=True, family="gen4-locked")
    with pytest.raises(SdoAborted) as caught:
        access.request(NmtState.PRE_OPERATIONAL)
    assert caught.value.why == "the device says 8 at 0x5310:00: the access level is too low"
    assert log_in(access, 4, lambda: 0x4444) == 4


def test_firmware_that_aborts_the_user_id_is_logged_in_all_the_same() -> None:
    device = StrictDevice(dictionary("gen4"), load_family("gen4-locked"), NODE)
    device.boot_up()

    class Choosy(DirectSdo):
        """A device that takes no user ID."""

        def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
            if (index, sub_index) == (0x5000, 3):
                raise SdoAborted(index, sub_index, 0x0601_0002, node=NODE)
            super().download(index, sub_index, data)

    bus = DirectBus(device, Choosy(device))
    access = NodeAccess(bus, NODE, profile("gen4"))
    assert log_in(access, 4, lambda: 0x4444) == 4
    assert log_in(access, 4, lambda: pytest.fail("asked for a passcode that is not needed")) == 4
    assert log_in(access, 0, lambda: pytest.fail("logging out needs no passcode")) == 0


@pytest.mark.parametrize(("user", "sent"), [(None, b"\1\0"), (0x1234, b"\x34\x12")])
def test_who_one_is_and_the_passcode_are_two_bytes_each_and_logging_out_is_nobody_with_none(
    user: int | None, sent: bytes
) -> None:
    device = StrictDevice(dictionary("gen4"), load_family("gen4-locked"), NODE)
    device.boot_up()
    channel = DirectSdo(device)
    access = NodeAccess(DirectBus(device, channel), NODE, profile("gen4"))
    assert log_in(access, 4, lambda: 0x4444, user) == 4
    assert channel.writes == [(0x5000, 3, sent), (0x5000, 2, b"\x44\x44")]
    channel.writes.clear()
    assert log_in(access, 0, lambda: 0x4444) == 0
    assert channel.writes == [(0x5000, 3, b"\0\0"), (0x5000, 2, b"\0\0")]


def test_whether_a_node_is_a_master_is_one_byte() -> None:
    access = NodeAccess(DirectBus(booted("gen4"), Table({(0x5800, 0): b"\0\1"})), NODE, profile("gen4"))
    with pytest.raises(SdoProtocolError, match="0x5800:00 answered 2 bytes"):
        access.request(NmtState.PRE_OPERATIONAL)


def test_a_gate_that_was_agreed_to_is_entered_whatever_the_profile_says_and_left_again() -> None:
    device = booted()
    device.nmt(NmtCommand.START)
    gate = Gate(
        NodeAccess(DirectBus.of(device), NODE, profile("generic")), lambda _question: pytest.fail("asked again")
    )
    gate.enter()
    assert not gate.entered
    gate.enter_agreed()
    assert (gate.entered, device.state) == (True, NmtState.PRE_OPERATIONAL)
    gate.leave()
    assert device.state is NmtState.OPERATIONAL


@dataclass
class Late(DirectBus):
    """A bus on which a state is heard by whoever waits for it."""

    def nmt_state(self, node_id: int, timeout_s: float = 0.0) -> NmtState | None:
        return self.device.state if timeout_s >= 1 else None


@pytest.mark.parametrize("family", ["generic", "gen4"])
def test_a_state_that_only_heartbeats_tell_is_waited_for(family: str) -> None:
    """Also of a device that lacks the object in which its family tells it."""
    access = NodeAccess(Late(booted(), Table({})), NODE, profile(family))
    assert access.state() is None
    assert access.state(1.0) is NmtState.PRE_OPERATIONAL
    received = NodeAccess(DirectBus(booted(), Table({})), NODE, profile(family))
    assert received.state() is NmtState.PRE_OPERATIONAL


def test_a_node_of_which_nobody_knows_whether_it_is_a_master_takes_nmt_commands() -> None:
    device = booted("gen4")
    device.nmt(NmtCommand.START)
    bus = DirectBus.of(device)
    NodeAccess(bus, NODE, replace(profile("gen4"), master_object=None)).request(NmtState.PRE_OPERATIONAL)
    assert device.state is NmtState.PRE_OPERATIONAL
    assert bus.sdo(NODE).writes == []  # type: ignore[attr-defined]


@dataclass
class Odd(DirectBus):
    """A device that obeys no NMT command before the *obeys*-th, and restarts where it *restarts* instead of obeying."""

    obeys: int = 99
    restarts: bool = False

    def send_nmt(self, command: NmtCommand, node_id: int) -> None:
        self.commands.append(command)
        if len(self.commands) >= self.obeys:
            self.device.nmt(command)
        elif self.restarts:
            self.heard_boot_ups += 1


def odd(obeys: int, *, restarts: bool) -> tuple[NodeAccess, Odd]:
    device = booted()
    bus = Odd(device, DirectSdo(device), obeys=obeys, restarts=restarts)
    return NodeAccess(bus, NODE, profile("generic")), bus


def test_one_that_stays_where_it_is_is_not_asked_again() -> None:
    access, bus = odd(99, restarts=False)
    with pytest.raises(DeviceRefused, match="did not reach OPERATIONAL"):
        access.insist(NmtState.OPERATIONAL)
    assert bus.commands == [NmtCommand.START]


def test_one_that_restarted_after_it_was_asked_is_asked_again() -> None:
    access, bus = odd(3, restarts=True)
    access.insist(NmtState.OPERATIONAL)
    assert (bus.device.state, bus.commands) == (NmtState.OPERATIONAL, [NmtCommand.START] * 3)
