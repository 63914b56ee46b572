"""What is known of a node without asking it: what was read since something could have changed it, and no longer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import pytest

from dvtcli.device.lazy_pdos import LazyMapping
from dvtcli.device.looking import Looking
from dvtcli.device.node import Node
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.object_dictionary import Access, ObjectDictionary
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import GENERIC
from dvtcli.errors import BusUnavailable, SdoAborted
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, profile

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
    node.memory.clear()
    assert timer(node) == 79
    set_timer(node, 80)
    assert node.pdos()[TPDO1].communication.event_timer == 80
    set_timer(node, 81)
    assert node.pdo(TPDO1).communication.event_timer == 81


def test_what_a_claim_finds_is_read_anew(node: Node) -> None:
    timer(node)
    set_timer(node, 77)
    node.claim()
    assert timer(node) == 77


def test_what_was_read_last_is_shown_until_it_is_known_to_be_otherwise(node: Node) -> None:
    held = node.pdos()
    assert node.last_seen == node.last_read == node.came_up.pdos == held
    set_timer(node, 77)
    now = node.pdo(TPDO1)
    assert node.last_seen == node.last_read == {**held, TPDO1: now}
    node.read_anew()
    assert (node.last_read, node.last_seen) == ({}, {**held, TPDO1: now})
    node.is_unknown_now()
    assert node.last_seen == {}


def test_a_command_by_hand_ends_what_the_gate_knew(bus: Bus) -> None:
    node = Node(bus, NODE, dictionary("generic"), profile("gen4"))
    timer(node)
    set_timer(node, 77)
    node.gate.enter()
    node.commanded()
    assert timer(node) == 77
    bus.device.nmt(NmtCommand.START)
    node.gate.enter()
    assert bus.device.state is NmtState.PRE_OPERATIONAL


def test_a_look_is_told_with_how_many_pdos_were_read(node: Node) -> None:
    seen: list[Looking] = []
    node.on_look = seen.append
    node.pdos()
    total = len(node.present())
    assert (seen[0].done, seen[-1].done, {one.total for one in seen if one.index >= 0x1400}) == (0, total - 1, {total})
    node.upload(*HEARTBEAT)
    assert seen[-1] == Looking(NODE, *HEARTBEAT, 0, 0)


def described(access: Access) -> ObjectDictionary:
    """The generic file, in which TPDO1's count has another access."""
    generic = dictionary("generic")
    one = generic[0x1A00]
    entries = {**one.entries, 0: replace(one.entries[0], access=access)}
    return ObjectDictionary({**generic, 0x1A00: replace(one, entries=entries)}, generic.info, "described.eds")


@pytest.mark.parametrize(
    ("described", "pdo", "dynamic"),
    [
        (described(Access.RO), "tpdo1", False), (described(Access.RW), "tpdo1", True),
        (described(Access.RO), "tpdo400", True), (None, "tpdo1", True),
    ],
)  # fmt: skip
def test_a_mapping_may_be_changed_unless_the_file_says_otherwise(
    bus: Bus, described: ObjectDictionary | None, pdo: str, dynamic: bool
) -> None:
    assert Node(bus, NODE, described).is_dynamic(Pdo.parse(pdo)) is dynamic


def test_who_a_node_is(node: Node, bus: Bus) -> None:
    held = {
        name: int.from_bytes(bus.channel.upload(0x1018, sub_index), "little")
        for sub_index, name in enumerate(("vendor", "product", "revision", "serial"), 1)
    }
    assert len(set(held.values())) > 1
    assert node.identity() == held
    info = replace(dictionary("generic").info, product_name="Pump 3")
    objects = {0x1018: dictionary("generic")[0x1018]}
    named = Node(bus, NODE, ObjectDictionary(objects, info))
    unnamed = Node(bus, NODE, ObjectDictionary(objects, replace(info, product_name="")))
    assert (named.title, unnamed.title, Node(bus, NODE).title) == ("Pump 3", GENERIC.title, GENERIC.title)


def test_the_length_of_an_object_is_the_file_s_else_what_an_upload_brings(node: Node, bus: Bus) -> None:
    channel = bus.channel
    assert isinstance(channel, DirectSdo)
    assert node.length_of(0x6041, 0) == 16
    assert channel.reads == []
    silent = Node(bus, NODE)
    assert (silent.length_of(0x6041, 0), silent.length_of(0x5FFF, 0)) == (16, None)
    generic = dictionary("generic")
    one = generic[0x6041]
    untyped = replace(one, entries={0: replace(one.entries[0], data_type=None)})
    assert Node(bus, NODE, ObjectDictionary({0x6041: untyped})).length_of(0x6041, 0) == 16


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


def test_what_is_read_when_it_is_looked_at_has_a_length() -> None:
    lazy = LazyMapping(lambda: (TPDO1, Pdo.parse("rpdo1")), str)
    assert (len(lazy), dict(lazy)) == (2, {TPDO1: "tpdo1", Pdo.parse("rpdo1"): "rpdo1"})
