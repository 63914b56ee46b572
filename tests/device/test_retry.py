"""What is tried again with the PDO off: what was refused while it was on, and nothing else."""

from __future__ import annotations

import pytest

from dvtcli.device.node import Node
from dvtcli.domain.abort import Abort
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import DeviceRefused, SdoAborted
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

TPDO1 = Pdo.parse("tpdo1")


class Strict(DirectSdo):
    """A device that takes a parameter never (`never`), or only while the PDO is off (`only_off`)."""

    never: int = 0
    only_off: int = 0

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        enabled = not self.device.upload(0x1800, 1)[3] & 0x80
        if (index, sub_index) in ((0x1800, self.never), (0x1800, self.only_off if enabled else -1)):
            self.writes.append((index, sub_index, bytes(data)))
            raise SdoAborted(index, sub_index, Abort.VALUE_RANGE, node=NODE)
        super().download(index, sub_index, data, timeout_s=timeout_s)


@pytest.fixture
def channel() -> Strict:
    return Strict(booted())


@pytest.fixture
def node(channel: Strict) -> Node:
    return Node(DirectBus(channel.device, channel), NODE, dictionary("generic"))


def test_what_is_refused_while_the_pdo_is_off_is_not_tried_again(node: Node, channel: Strict) -> None:
    before, channel.never = node.pdo(TPDO1), 3
    with pytest.raises(DeviceRefused) as caught:
        node.configure({TPDO1: PdoRequest(inhibit_time=55)})
    assert (caught.value.place, caught.value.state) == ("1800:03", "rolled_back")
    assert "first try" not in dict(caught.value.details)
    assert [place for *place, _ in channel.writes if place == [0x1800, 3]] == [[0x1800, 3]]
    assert node.pdo(TPDO1) == before


def test_what_is_refused_while_it_is_on_is_made_with_it_off_and_asked_for_right_away_from_the_third_time(
    node: Node, channel: Strict
) -> None:
    channel.only_off = 5
    refused = []
    for timer_ms in (50, 60, 70):
        channel.writes.clear()
        applied = node.configure({TPDO1: PdoRequest(event_timer=timer_ms)})
        refused.append(channel.writes[0][:2] == (0x1800, 5))
        assert ["off-first" in finding.rule for finding in applied.findings] == ([True] if refused[-1] else [])
        assert node.pdo(TPDO1).communication.event_timer == timer_ms
    assert refused == [True, True, False]


def test_a_device_of_which_nothing_was_found_out_is_not_asked_who_it_is(node: Node, channel: Strict) -> None:
    node.configure({TPDO1: PdoRequest(event_timer=50)})
    assert not [place for place in channel.reads if place[0] == 0x1018]


def test_it_is_told_which_of_several_parameters_was_refused(node: Node, channel: Strict) -> None:
    channel.only_off = 5
    applied = node.configure({TPDO1: PdoRequest(transmission_type=1, event_timer=50)})
    (told,) = [finding for finding in applied.findings if finding.rule == "off-first"]
    assert "1800:05" in told.place
    assert node.pdo(TPDO1).communication.event_timer == 50
