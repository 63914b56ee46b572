"""Node guarding of a simulated node: one byte on a remote frame, its toggle bit, and when there is no answer."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.nodes.test_nmt import guarded
from tests.simulator.bench import booted

REQUEST = Frame(0x701, b"", remote=True)


@pytest.fixture
def node() -> StrictDevice:
    device = guarded()
    device.boot_up()
    device.take_outbox()
    return device


def answers(device: StrictDevice) -> list[bytes]:
    return [frame.data for frame in device.services.receive(REQUEST)]


def test_the_toggle_bit_alternates_and_starts_over_with_a_boot_up(node: StrictDevice) -> None:
    assert [answers(node) for _ in range(3)] == [[b"\x7f"], [b"\xff"], [b"\x7f"]]
    node.nmt(NmtCommand.RESET_COMMUNICATION)
    node.set_value(0x1017, 0, b"\0\0")
    assert answers(node) == [b"\x7f"]


@pytest.mark.parametrize(
    ("command", "state"), [(NmtCommand.START, NmtState.OPERATIONAL), (NmtCommand.STOP, NmtState.STOPPED)]
)
def test_it_is_answered_in_every_state(node: StrictDevice, command: NmtCommand, state: NmtState) -> None:
    node.nmt(command)
    assert answers(node) == [bytes([state])]


def test_a_node_with_heartbeats_or_without_a_guard_time_is_silent(node: StrictDevice) -> None:
    node.set_value(0x1017, 0, b"\x64\0")
    assert answers(node) == []
    other = booted()
    other.set_value(0x1017, 0, b"\0\0")
    assert answers(other) == []
    assert not node.services.receive(Frame(0x702, b"", remote=True))
    assert not node.services.receive(Frame(0x701, b"\5"))
