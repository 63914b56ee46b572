"""A node that is changed: what is refused, what is remembered, and what a restart or `undo` leaves of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.device.change.undo_plan import UndoRequest
from dvtcli.device.node import Node
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import DeviceRefused, RuleError, SafetyRefusal
from dvtcli.files.eds.reader import read_eds
from tests.device.test_rolling_back import odd_device
from tests.laws.bench import NODE, DirectBus, DirectSdo, FaultySdo, booted, dictionary, refuse
from tests.small_eds import INPUTS, OUTPUTS, plain

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
HEARTBEAT = (0x1017, 0)


@pytest.fixture
def bus() -> DirectBus:
    return DirectBus.of(booted())


@pytest.fixture
def node(bus: DirectBus) -> Node:
    return Node(bus, NODE, dictionary("generic"))


def timers(node: Node) -> list[int | None]:
    return [node.pdo(pdo).communication.event_timer for pdo in (TPDO1, TPDO2)]


def set_timer(node: Node, pdo: Pdo, timer_ms: int) -> None:
    node.configure({pdo: PdoRequest(event_timer=timer_ms)})


def test_a_file_of_another_device_is_refused_for_one_object_too(node: Node) -> None:
    node.unlike_file = "a.eds is about vendor 0x00000001, node 1 is vendor 0x00000002"
    held = node.upload(*HEARTBEAT)
    with pytest.raises(SafetyRefusal, match=r"the EDS is another device's: a\.eds"):
        node.write(*HEARTBEAT, b"\1\0")
    assert node.upload(*HEARTBEAT) == held
    node.write(*HEARTBEAT, b"\1\0", force=True)
    assert node.upload(*HEARTBEAT) == b"\1\0"


@pytest.mark.parametrize(
    ("place", "data", "rule"),
    [
        ((0x1018, 1), b"\1\0\0\0", "access"),
        ((0x1017, 0), b"\1\0\0\0", "length"),
        ((0x1005, 0), b"\x81\1\0\0", "can-id-in-use"),
        ((0x1800, 1), b"\x80\0\0\0", "cob-id-while-valid"),
    ],
)
def test_what_a_rule_forbids_to_write_to_one_object_is_not_sent(
    node: Node, bus: DirectBus, place: tuple[int, int], data: bytes, rule: str
) -> None:
    with pytest.raises(RuleError) as caught:
        node.write(*place, data)
    assert [finding.rule for finding in caught.value.findings] == [rule]
    assert isinstance(bus.channel, DirectSdo)
    assert (bus.channel.writes, node.history) == ([], [])


def test_what_is_so_already_beside_it_forbids_no_force(node: Node) -> None:
    held = node.pdo(TPDO1).communication.event_timer
    wants = {TPDO1: PdoRequest(event_timer=held), TPDO2: PdoRequest(cob_id=0x80)}  # SYNC's
    with pytest.raises(RuleError):
        node.configure(wants)
    node.configure(wants, force=True)
    assert node.pdo(TPDO2).communication.cob_id.can_id == 0x80


def test_undo_takes_back_the_last_change_and_no_others_and_not_what_somebody_else_did(node: Node) -> None:
    before = timers(node)
    set_timer(node, TPDO1, 70)
    set_timer(node, TPDO2, 80)
    node.undo()
    assert timers(node) == [70, before[1]]
    assert node.undone_earlier == 0, "it was one of ours"
    node.sdo.download(0x1800, 5, b"\x09\x00")
    with pytest.raises(SafetyRefusal, match="does not hold the values of that change"):
        node.undo()
    node.undo(force=True)
    assert timers(node) == before
    assert (node.history, node.unstored) == ([], {})


def test_what_others_changed_is_put_back_one_by_one_and_counted(node: Node) -> None:
    before = timers(node)
    set_timer(node, TPDO1, 70)
    set_timer(node, TPDO2, 80)
    plans, node.history = list(node.history), []
    _, count = node.undo_plans(UndoRequest(plans))
    assert (timers(node), count, node.undone_earlier) == ([70, before[1]], 1, 1)
    node.sdo.download(0x1800, 5, b"\x09\x00")
    with pytest.raises(SafetyRefusal):
        node.undo_plans(UndoRequest(plans[:1]))
    node.undo_plans(UndoRequest(plans[:1], force=True))
    assert (timers(node), node.undone_earlier) == (before, 2)


def test_of_a_chain_that_somebody_else_broke_only_what_came_after_is_put_back(node: Node) -> None:
    set_timer(node, TPDO1, 70)
    node.sdo.download(0x1800, 5, b"\x09\x00")
    set_timer(node, TPDO1, 80)
    _, count = node.undo_plans(UndoRequest(node.history, everything=True))
    assert (node.pdo(TPDO1).communication.event_timer, count) == (9, 1)


def test_a_restart_takes_what_was_not_stored_and_is_told_once(node: Node, bus: DirectBus) -> None:
    node.notice_reboot()
    set_timer(node, TPDO1, 70)
    assert node.plans_in_effect() == node.history
    bus.send_nmt(NmtCommand.RESET_NODE, NODE)
    assert node.plans_in_effect() == []
    assert node.last_seen != {}
    assert node.notice_reboot() == ("TPDO1",)
    assert (node.last_seen, node.plans_in_effect(), node.notice_reboot()) == ({}, [], ())


def test_a_reset_that_was_asked_for_takes_it_too(node: Node, bus: DirectBus) -> None:
    set_timer(node, TPDO1, 70)
    bus.send_nmt(NmtCommand.RESET_NODE, NODE)
    assert node.was_reset(communication=False) == ("TPDO1",)
    assert (node.last_seen, node.unstored, node.plans_in_effect()) == ({}, {}, [])


def test_a_reset_of_the_communication_takes_communication_objects_only(node: Node, bus: DirectBus) -> None:
    set_timer(node, TPDO1, 70)
    node.pending.changed("6060:00", 0x6060)
    bus.send_nmt(NmtCommand.RESET_COMMUNICATION, NODE)
    assert node.was_reset(communication=True) == ("TPDO1",)
    assert node.unstored == {"6060:00": 0x6060}


def test_after_a_restore_no_number_of_changes_stands_for_what_is_held(node: Node) -> None:
    set_timer(node, TPDO1, 70)
    set_timer(node, TPDO2, 80)
    node.pending.was_restored(len(node.history))
    assert node.plans_in_effect() == []
    assert not any(node.pending.is_as_stored(count) for count in range(3))


def test_only_what_can_be_read_again_is_compared_later(node: Node) -> None:
    """A part of a PDO is compared with the PDO, and what is write-only not at all."""
    node.write(*HEARTBEAT, b"\1\0")
    node.sdo.download(0x1800, 1, (0xC000_0181).to_bytes(4, "little"))
    node.sdo.download(0x1A00, 0, b"\0")
    old = node.upload(0x1A00, 5)
    node.apply(Plan(NODE, (ValueChange(Step(0x1A00, 5, old, (0x6041_0010).to_bytes(4, "little"), "an entry")),)))
    write_only = Step(0x1006, 0, None, b"\2\0\0\0", "write-only, as it was said")
    node.apply(Plan(NODE, (ValueChange(write_only),)))
    assert node.wanted_values == {HEARTBEAT: b"\1\0"}
    assert node.unreadable_values == {(0x1006, 0): b"\2\0\0\0"}


def test_what_was_found_is_there_again_once_all_is_undone_but_for_what_nobody_can_read(node: Node) -> None:
    node.write(*HEARTBEAT, b"\1\0")
    node.undo()
    assert node.unstored == {}
    before = node.upload(*HEARTBEAT)
    write_only = ValueChange(Step(0x1006, 0, None, b"\1\0\0\0", "write-only, as it was said"))
    node.apply(Plan(NODE, (ValueChange(Step(*HEARTBEAT, before, b"\1\0", "write")), write_only)))
    applied = node.undo()
    assert [finding.rule for finding in applied.findings] == ["write-only"]
    assert (node.history, "1006:00" in node.unstored) == ([], True)


def test_an_undo_that_the_device_takes_otherwise_is_no_change_to_undo() -> None:
    sdo = odd_device()
    node = Node(DirectBus(sdo.device, sdo), NODE)
    before = node.pdo(TPDO1)
    want = PdoConfig(before.communication, (PdoMappingEntry(INPUTS, 3, 8),))
    node.apply(Plan(NODE, (plan_pdo(TPDO1, before, want),)))
    applied = node.undo()
    assert [finding.rule for finding in applied.not_put_back] == ["way-back"]
    assert (node.pdo(TPDO1).enabled, node.pdo(TPDO1).count, node.history) == (False, 0, [])
    assert node.unstored != {}


def test_an_undo_that_is_refused_once_is_not_tried_another_way(node: Node, bus: DirectBus) -> None:
    set_timer(node, TPDO1, 70)
    bus.channel = FaultySdo(bus.channel, refuse, 1)
    with pytest.raises(DeviceRefused) as caught:
        node.undo()
    assert (caught.value.state, timers(node)[0], len(node.history)) == ("rolled_back", 70, 1)


def test_half_a_pdo_is_changed_with_force_and_one_that_is_so_already_is_not_said_to_be() -> None:
    eds = plain()
    del eds.objects[0x1400][1][1]
    path = Path("half.eds")
    path.write_text(eds.text())
    described = read_eds(path).dictionary
    node = Node(DirectBus.of(booted("generic", described)), NODE, described)
    rpdo1, want = Pdo.parse("rpdo1"), PdoRequest(objects=(PdoMappingEntry(OUTPUTS, 1, 8),) * 2)
    with pytest.raises(RuleError):
        node.configure({rpdo1: want})
    node.configure({rpdo1: want}, force=True)
    assert node.pdo(rpdo1).count == 2
    with pytest.raises(RuleError):
        node.configure({rpdo1: want}, force=True)
