"""What is known of a node without asking it: what was read since something could have changed it, and no longer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from dvtcli.device.node import Node
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import BusUnavailable, SdoAborted
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

TPDO1 = Pdo.parse("tpdo1")
HEARTBEAT = (0x1017, 0)


@dataclass
class Bus(DirectBus):
    """A network on which others may write, and which may die."""

    others: int = 0
    dead: bool = False

    def downloads_of_others(self, node_id: int) -> int:
        return self.others

    def boot_ups(self, node_id: int) -> int:
        if self.dead:
            raise BusUnavailable("the bus is dead")
        return self.heard_boot_ups


@pytest.fixture
def bus() -> Bus:
    device = booted()
    return Bus(device, DirectSdo(device))


@pytest.fixture
def node(bus: Bus) -> Node:
    return Node(bus, NODE, dictionary("generic"))


def set_timer(node: Node, timer_ms: int) -> None:
    """Somebody else gives TPDO1 another event timer."""
    node.bus.sdo(NODE).download(0x1800, 5, timer_ms.to_bytes(2, "little"))


def timer(node: Node) -> int | None:
    return node.known_pdo(TPDO1).communication.event_timer


def test_what_was_read_is_not_asked_for_again_until_something_happened(node: Node, bus: Bus) -> None:
    before = timer(node)
    set_timer(node, 77)
    assert timer(node) == before
    bus.others += 1
    assert timer(node) == 77
    set_timer(node, 78)
    assert timer(node) == 77, "what happened before it was read happened once"
    bus.heard_boot_ups += 1
    assert timer(node) == 78
    set_timer(node, 79)
    node.read_cache.clear()
    assert timer(node) == 79
    set_timer(node, 80)
    assert node.pdos()[TPDO1].communication.event_timer == 80
    set_timer(node, 81)
    assert node.pdo(TPDO1).communication.event_timer == 81


def test_values_are_of_now_until_something_happens_and_from_the_next_read_on(node: Node, bus: Bus) -> None:
    cache = node.read_cache
    assert not cache.is_of_now(), "nothing was read"
    for happens in ("boot-up", "another boot-up"):
        timer(node)
        assert cache.is_of_now()
        bus.heard_boot_ups += 1
        assert not cache.is_of_now(), happens
    timer(node)
    cache.clear()
    assert not cache.is_of_now()


def test_what_a_claim_finds_is_read_anew(node: Node) -> None:
    timer(node)
    set_timer(node, 77)
    node.begin_change()
    assert timer(node) == 77


def test_an_object_that_was_refused_is_refused_from_memory_too(node: Node, bus: Bus) -> None:
    for _ in range(2):
        with pytest.raises(SdoAborted) as caught:
            node.known_value(0x5FFF, 0)
        assert (caught.value.code, caught.value.node) == (0x0602_0000, NODE)
    channel: Any = bus.channel
    assert channel.reads == [(0x5FFF, 0)]


def test_a_dead_bus_tells_of_no_restart(node: Node, bus: Bus) -> None:
    assert node.notice_reboot() == ()
    bus.dead = True
    assert node.notice_reboot() == ()
