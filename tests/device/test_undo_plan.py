"""From what a node holds to what it held before: the oldest value of each object, and nothing that is so already."""

from __future__ import annotations

import pytest

from dvtcli.device.change.undo_plan import refuse_unless_left, undo_plan_of
from dvtcli.device.node import Node
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import SafetyRefusal
from tests.laws.bench import NODE, DirectBus, booted, dictionary

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
HEARTBEAT, ENTRY = (0x1017, 0), (0x1A00, 5)
STATUSWORD = (0x6041_0010).to_bytes(4, "little")


@pytest.fixture
def node() -> Node:
    return Node(DirectBus.of(booted()), NODE, dictionary("generic"))


def timed(node: Node, pdo: Pdo, timer_ms: int) -> PdoConfig:
    now = node.pdo(pdo)
    return now.with_parameters(event_timer=timer_ms)


def from_to(node: Node, pdo: Pdo, before_ms: int, after_ms: int) -> PdoChange:
    return plan_pdo(pdo, timed(node, pdo, before_ms), timed(node, pdo, after_ms))


def written(before: int, after: int, place: tuple[int, int] = HEARTBEAT, size: int = 2) -> ValueChange:
    return ValueChange(Step(*place, before.to_bytes(size, "little"), after.to_bytes(size, "little"), "write"))


def plans(*changes: Change) -> list[Plan]:
    """Each change in a plan of its own, oldest first."""
    return [Plan(NODE, (change,)) for change in changes]


def hold(node: Node, timer_ms: int, pdo: Pdo = TPDO1) -> None:
    node.sdo.download(pdo.communication_index, 5, timer_ms.to_bytes(2, "little"))


@pytest.mark.parametrize("together", [False, True])
def test_the_oldest_value_of_each_object_is_put_back(node: Node, together: bool) -> None:
    changes = (
        from_to(node, TPDO1, 3, 4), written(30, 40), from_to(node, TPDO1, 4, 5), written(40, 50),
    )  # fmt: skip
    made = [Plan(NODE, changes)] if together else plans(*changes)
    hold(node, 5)
    node.sdo.download(*HEARTBEAT, b"\x32\0")
    node.read_anew()
    back = undo_plan_of(node, made)
    assert [(step.object, step.before, step.after) for step in back.steps] == [
        ("1800:05", b"\5\0", b"\3\0"), ("1017:00", b"\x32\0", b"\x1e\0"),
    ]  # fmt: skip


def test_what_is_as_it_was_is_not_written(node: Node) -> None:
    held = int.from_bytes(node.upload(*HEARTBEAT), "little")
    assert undo_plan_of(node, plans(written(held, held + 1))).changes == ()


@pytest.mark.parametrize(
    ("on", "count", "put_back"), [(True, 1, False), (False, 1, False), (False, 2, False), (False, 0, True)]
)
def test_an_entry_behind_the_count_is_put_back_only_where_the_mapping_is_open(
    node: Node, on: bool, count: int, put_back: bool
) -> None:
    sdo = node.sdo
    word = 0x4000_0181
    for sub_index, data in ((0, b"\0"), (1, STATUSWORD), (2, STATUSWORD), (5, STATUSWORD), (0, bytes([count]))):
        if not sub_index:
            sdo.download(0x1800, 1, (word | 1 << 31).to_bytes(4, "little"))
        sdo.download(0x1A00, sub_index, data)
    if on:
        sdo.download(0x1800, 1, word.to_bytes(4, "little"))
    back = undo_plan_of(node, plans(written(0, int.from_bytes(STATUSWORD, "little"), ENTRY, 4)))
    assert [step.object for step in back.steps] == (["1A00:05"] if put_back else [])


def test_an_enabled_pdo_that_maps_nothing_takes_no_entry(node: Node) -> None:
    node.bus.sdo(NODE).device.set_value(0x1A00, 0, b"\0")  # type: ignore[attr-defined]
    assert node.pdo(TPDO1).enabled
    assert undo_plan_of(node, plans(written(1, 2, ENTRY, 4))).changes == ()


def test_what_is_still_there_is_taken_back_and_what_a_reset_took_is_counted(node: Node) -> None:
    made = plans(from_to(node, TPDO1, 3, 4), from_to(node, TPDO2, 3, 4), from_to(node, TPDO1, 4, 5))
    hold(node, 4, TPDO2)
    for held_ms, count, gone in ((5, 1, 1), (4, 1, 1), (5, 3, 3)):
        hold(node, held_ms)
        assert refuse_unless_left(node, made, count) == gone
    hold(node, 3)
    hold(node, 3, TPDO2)
    assert refuse_unless_left(node, made, 1) == 3, "a reset took them all"
    assert refuse_unless_left(node, made[:1], 1) == 1


def test_a_plan_that_changed_an_object_twice_began_at_the_first_value(node: Node) -> None:
    made = [Plan(NODE, (from_to(node, TPDO1, 3, 4), from_to(node, TPDO1, 4, 5)))]
    hold(node, 3)
    assert refuse_unless_left(node, made, 1) == 1
    hold(node, 4)
    with pytest.raises(SafetyRefusal):
        refuse_unless_left(node, made, 1)


def test_what_somebody_else_changed_is_not_taken_for_what_a_reset_took(node: Node) -> None:
    """The newest change is gone; what is left of the other is not what it left."""
    made = plans(from_to(node, TPDO1, 3, 4), from_to(node, TPDO2, 3, 4))
    hold(node, 9)
    hold(node, 3, TPDO2)
    with pytest.raises(SafetyRefusal) as caught:
        refuse_unless_left(node, made, 2)
    assert (
        caught.value.text == f"node {NODE} does not hold the values of that change: TPDO1 event timer is 9, expected 4"
    )
    assert caught.value.why == "TPDO2 event timer is 3, expected 4"
    with pytest.raises(SafetyRefusal) as alone:
        refuse_unless_left(node, made[:1], 1)
    assert alone.value.why is None


def test_single_objects_are_looked_at_too(node: Node) -> None:
    made = plans(written(30, 40), written(40, 50))
    for held, gone in ((50, 1), (40, 1), (30, 2)):
        node.sdo.download(*HEARTBEAT, held.to_bytes(2, "little"))
        assert refuse_unless_left(node, made, 1) == gone
    node.sdo.download(*HEARTBEAT, b"\x09\0")
    with pytest.raises(SafetyRefusal, match="1017:00 is 0x0009, expected 0x0032"):
        refuse_unless_left(node, made, 1)
