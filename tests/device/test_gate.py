"""The pre-operational gate over a reboot: a node that fell out of it is led back in, and nothing else is sent."""

from __future__ import annotations

import pytest

from dvtcli.device.nmt_gate import Gate, NodeAccess
from dvtcli.device.node import Node
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import NoAnswer
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, profile, silence

TPDO1 = Pdo.parse("tpdo1")


def gate(family: str = "gen4") -> tuple[Gate, DirectBus]:
    bus = DirectBus.of(booted(family))
    return Gate(NodeAccess(bus, NODE, profile(family)), lambda _question: None), bus


def test_a_node_that_fell_out_of_the_gate_is_led_back_in() -> None:
    opened, bus = gate()
    opened.enter()
    bus.device.nmt(NmtCommand.START)
    opened.renew()
    assert bus.device.state is NmtState.PRE_OPERATIONAL
    assert bus.commands == [NmtCommand.ENTER_PRE_OPERATIONAL]


def test_a_node_that_is_still_inside_is_left_alone() -> None:
    opened, bus = gate()
    opened.enter()
    opened.renew()
    assert bus.commands == []


def test_a_gate_that_was_not_entered_is_not_renewed() -> None:
    opened, bus = gate()
    bus.device.nmt(NmtCommand.START)
    opened.renew()
    assert bus.device.state is NmtState.OPERATIONAL


class Restarting(DirectSdo):
    """A device that restarts at the *at*-th write from now on, and starts itself: OPERATIONAL without being asked."""

    at = 0

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        if self.at:
            self.at -= 1
            if not self.at:
                self.device.nmt(NmtCommand.RESET_NODE)
                self.device.nmt(NmtCommand.START)
                self.device.take_outbox()
                raise silence(index, sub_index)
        super().download(index, sub_index, data, timeout_s=timeout_s)


def test_a_reboot_in_the_middle_of_a_change_is_rolled_back_through_the_gate() -> None:
    """What was in RAM only is lost by it, and a device that is OPERATIONAL again takes no write."""
    device = booted("gen4")
    channel = Restarting(device)
    node = Node(DirectBus(device, channel), NODE, dictionary("gen4"), profile("gen4"))
    node.configure({TPDO1: PdoRequest(event_timer=50)})
    before = node.pdo(TPDO1)
    channel.at = 1
    with pytest.raises(NoAnswer) as caught:
        node.configure({TPDO1: PdoRequest(event_timer=60)})
    assert caught.value.state == "rolled_back"
    assert node.pdo(TPDO1) == before
    assert before.communication.event_timer == 50
