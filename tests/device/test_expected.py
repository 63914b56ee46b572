"""What a node must hold to be stored, and what somebody else changed between two changes of ours."""

from __future__ import annotations

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.change.changeable import Expected
from dvtcli.device.change.undo_plan import refuse_gap
from dvtcli.device.node import Node
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import SafetyRefusal
from tests.laws.bench import NODE, DirectBus, booted, dictionary

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
HEARTBEAT, TARGET = (0x1017, 0), (0x6040, 0)


@pytest.fixture
def node() -> Node:
    return Node(DirectBus.of(booted()), NODE, dictionary("generic"))


def timed(config: PdoConfig, timer_ms: int) -> PdoConfig:
    return config.with_parameters(event_timer=timer_ms)


def written(node: Node, place: tuple[int, int], number: int, before: bytes | None = b"\0\0") -> ValueChange:
    return ValueChange(Step(*place, before, number.to_bytes(2, "little"), "write"))


def refused(expected: Expected, node: Node) -> SafetyRefusal:
    with pytest.raises(SafetyRefusal) as caught:
        expected.require(node, "a cat")
    return caught.value


def test_nothing_is_read_where_nothing_is_expected(node: Node) -> None:
    Expected().require(node, "a cat")
    assert node.bus.sdo(NODE).reads == []  # type: ignore[attr-defined]


def test_a_pdo_that_is_no_longer_so_is_named_with_how(node: Node) -> None:
    expected, now = Expected(), node.pdo(TPDO1)
    expected.changed(plan_pdo(TPDO1, now, now))
    expected.require(node, "a cat")
    expected.changed(plan_pdo(TPDO1, now, timed(now, 77)))
    error = refused(expected, node)
    assert error.text == "node 1 is not stored: TPDO1 differs from its verified value"
    assert error.place == "1800:01"
    assert error.why == f"TPDO1: event timer is {now.communication.event_timer}, expected 77"
    assert typed(error.hint).startswith("a cat, or it corrects written values, or altered this with a change of")


def test_what_was_seen_first_beside_a_change_counts(node: Node) -> None:
    expected, now = Expected(), node.pdo(TPDO2)
    expected.seen({TPDO2: timed(now, 5)})
    expected.seen({TPDO2: now})
    assert "TPDO2" in refused(expected, node).text
    expected.changed(plan_pdo(TPDO2, timed(now, 5), now))
    expected.require(node, "a cat")


def test_a_pdo_that_is_gone_is_a_difference(node: Node) -> None:
    expected, now = Expected(), node.pdo(TPDO1)
    expected.seen({Pdo.parse("tpdo400"): now})
    assert refused(expected, node).why == "TPDO400: it is gone"


def test_single_objects_count_unless_they_move_or_cannot_be_read(node: Node) -> None:
    expected = Expected()
    expected.changed(written(node, TARGET, 0x1234))  # a controlword: an RPDO may take it at any time
    expected.changed(written(node, (0x2005, 1), 1, None))  # write-only
    expected.require(node, "a cat")
    expected.changed(written(node, HEARTBEAT, 1000))
    error = refused(expected, node)
    assert (error.place, error.why) == ("1017:00", "0x1017:00 is 0x01F4, was set to 0x03E8")
    assert error.text == "node 1 is not stored: 0x1017:00 differs from its verified value"
    expected.changed(written(node, HEARTBEAT, 500))
    expected.require(node, "a cat")


def test_what_an_rpdo_could_take_counts_as_long_as_none_takes_it(node: Node) -> None:
    taken = next(entry for entry in node.pdo(Pdo.parse("rpdo1")).mapping if entry.index >= 0x6000)
    expected = Expected()
    expected.changed(written(node, (taken.index, taken.sub_index), 0x1234))
    expected.require(node, "a cat")
    expected.changed(written(node, (0x6072, 0), 0x1234))
    assert refused(expected, node).place == "6072:00"


def test_a_node_without_a_dictionary_has_no_object_that_moves() -> None:
    node = Node(DirectBus.of(booted()), NODE)
    expected = Expected()
    expected.changed(written(node, TARGET, 0x1234))
    assert refused(expected, node).place == "6040:00"


def test_part_of_a_pdo_takes_the_place_of_the_whole_and_the_other_way_round(node: Node) -> None:
    expected, now = Expected(), node.pdo(TPDO1)
    expected.changed(plan_pdo(TPDO1, now, timed(now, 77)))
    expected.changed(written(node, (0x1801, 5), 9))
    expected.changed(written(node, (0x1800, 5), 5))
    assert (expected.pdos.keys(), expected.values.keys()) == (set(), {(0x1801, 5), (0x1800, 5)})
    expected.changed(plan_pdo(TPDO1, now, now))
    assert (expected.pdos, expected.values.keys()) == ({TPDO1: now}, {(0x1801, 5)})
    expected.clear()
    assert (expected.pdos, expected.values) == ({}, {})


def test_between_changes_that_join_nobody_was(node: Node) -> None:
    now = node.pdo(TPDO1)
    first, back = plan_pdo(TPDO1, now, timed(now, 5)), plan_pdo(TPDO1, timed(now, 5), now)
    again = plan_pdo(TPDO1, now, timed(now, 6))  # a reset took the first one, or it was undone
    refuse_gap(node, plans(first, again))
    refuse_gap(node, plans(first, plan_pdo(TPDO1, timed(now, 5), timed(now, 6)), back))
    refuse_gap(node, plans(written(node, HEARTBEAT, 5), written(node, HEARTBEAT, 7, b"\5\0")))
    refuse_gap(node, plans(written(node, HEARTBEAT, 5), written(node, HEARTBEAT, 7)))
    refuse_gap(node, plans(written(node, (0x2005, 1), 5, None), written(node, (0x2005, 1), 6, None)))


def test_between_changes_that_do_not_join_somebody_was(node: Node) -> None:
    now = node.pdo(TPDO1)
    ours, later = plan_pdo(TPDO1, now, timed(now, 5)), plan_pdo(TPDO1, timed(now, 6), timed(now, 7))
    with pytest.raises(SafetyRefusal, match="TPDO1 of node 1 between") as caught:
        refuse_gap(node, plans(ours, later))
    assert caught.value.why == "event timer is 6, expected 5"
    assert "it restarted, or another client wrote to it: `undo`" in typed(caught.value.hint)
    with pytest.raises(SafetyRefusal, match="1017:00 of node 1 between") as caught:
        refuse_gap(node, plans(written(node, HEARTBEAT, 5), written(node, HEARTBEAT, 7, b"\6\0")))
    assert caught.value.why == "was 0x0005, became 0x0006"


def test_a_write_to_a_part_of_a_pdo_is_no_gap_and_other_pdos_are_none_of_it(node: Node) -> None:
    now = node.pdo(TPDO1)
    ours, later = plan_pdo(TPDO1, now, timed(now, 5)), plan_pdo(TPDO1, timed(now, 6), timed(now, 7))
    refuse_gap(node, plans(ours, written(node, (0x1800, 5), 6), later))
    with pytest.raises(SafetyRefusal):
        refuse_gap(node, plans(ours, written(node, (0x1801, 5), 6), later))


def plans(*changes: Change) -> list[Plan]:
    """Each change in a plan of its own, oldest first."""
    return [Plan(NODE, (change,)) for change in changes]


def test_it_is_whole_once_all_that_lay_beside_a_change_was_read(node: Node) -> None:
    expected, now = Expected(), {TPDO2: node.pdo(TPDO2)}
    for others, whole, so in (({}, True, False), (now, False, False), (now, True, True), (now, False, True)):
        expected.seen(others, complete=whole)
        assert expected.is_complete is so
    expected.clear()
    assert expected.is_complete is False
