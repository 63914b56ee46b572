"""Several changes of one node as one plan: from before the first to after the last, put back from its end."""

from __future__ import annotations

from dataclasses import replace

from dvtcli.device.change.change_group import ChangeGroup
from dvtcli.device.change.combined_plan import ChangesToRollBack, combine_plans
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import Plan, Step, ValueChange, plan_pdo
from tests.laws.bench import NODE, DirectSdo, booted

TPDO1, TPDO2 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2")
SDO = DirectSdo(booted())
HELD = {pdo: read_pdo(SDO, pdo) for pdo in (TPDO1, TPDO2)}


def timed(pdo: Pdo, before_ms: int, after_ms: int) -> Plan:
    """*pdo* gets another event timer."""
    return Plan(NODE, (plan_pdo(pdo, at(pdo, before_ms), at(pdo, after_ms)),))


def at(pdo: Pdo, event_timer: int) -> PdoConfig:
    return HELD[pdo].with_parameters(event_timer=event_timer)


def written(index: int, sub_index: int, before: int, after: int) -> Plan:
    step = Step(index, sub_index, before.to_bytes(4, "little"), after.to_bytes(4, "little"), "write")
    return Plan(NODE, (ValueChange(step),))


def test_the_first_value_and_the_last_one_count() -> None:
    combined = combine_plans(
        NODE, [timed(TPDO1, 0, 5), written(0x2000, 0, 1, 2), timed(TPDO1, 5, 9), written(0x2000, 0, 2, 3)]
    )
    pdo, value = combined.changes
    assert (pdo.before, pdo.after) == (at(TPDO1, 0), at(TPDO1, 9))  # type: ignore[union-attr]
    assert (next(iter(value.steps)).before, next(iter(value.steps)).after) == (b"\1\0\0\0", b"\3\0\0\0")


def test_what_the_first_one_is_put_back_to_counts() -> None:
    plans = [timed(TPDO1, 0, 5), timed(TPDO1, 5, 9)]
    first = Plan(NODE, tuple(one._replace(substitute=at(TPDO1, 1)) for one in plans[0].changes))  # type: ignore[call-arg]
    (change,) = combine_plans(NODE, [first, plans[1]]).changes
    assert change.substitute == at(TPDO1, 1)  # type: ignore[union-attr]


def test_changes_of_several_pdos_and_objects_stay_in_order() -> None:
    plans = [timed(TPDO2, 0, 5), written(0x2000, 1, 1, 2), timed(TPDO1, 0, 5), written(0x2000, 2, 1, 2)]
    assert [change.label for change in combine_plans(NODE, plans).changes] == ["TPDO2", "2000:01", "TPDO1", "2000:02"]


def test_what_was_written_to_a_pdo_that_is_put_back_whole_counts_no_longer() -> None:
    plans = [written(0x1800, 3, 0, 7), timed(TPDO1, 0, 5), written(0x1A00, 1, 1, 2), written(0x1801, 3, 0, 7)]
    assert [change.label for change in combine_plans(NODE, plans).changes] == ["TPDO1", "1801:03"]


def test_but_for_an_entry_behind_the_count_of_a_mapping_that_was_empty() -> None:
    """It is put back after the PDO, which makes room for it: so it stands before it."""
    empty = replace(HELD[TPDO1].disabled(), mapping=())
    mapped = replace(empty, mapping=HELD[TPDO1].mapping)
    on_and_empty = replace(HELD[TPDO1], mapping=())
    entry, count = written(0x1A00, 1, 1, 2), written(0x1A00, 0, 0, 1)
    for before, labels in ((empty, ["1A00:01", "TPDO1"]), (mapped, ["TPDO1"]), (on_and_empty, ["TPDO1"])):
        after = before.with_parameters(event_timer=77)
        change = Plan(NODE, (plan_pdo(TPDO1, before, after),))
        for plans in ([entry, change], [change, entry], [count, entry, change, written(0x1800, 2, 1, 2)]):
            assert [one.label for one in combine_plans(NODE, plans).changes] == labels


def test_what_stands_alone_is_put_back_alone_and_ids_are_nobody_else_s() -> None:
    contents, alone = ChangesToRollBack(), ChangeGroup()
    first = contents.begin(alone, timed(TPDO1, 0, 5), 5)
    contents.carried_out()
    second = contents.begin(alone, timed(TPDO2, 0, 5), 127)
    assert (contents.plan, contents.nmt_state, contents.made) == (timed(TPDO2, 0, 5), 127, [])
    assert (len(first), len(second), first != second) == (32, 32, True)


def test_of_a_group_each_change_that_was_carried_out_counts_once() -> None:
    contents, group = ChangesToRollBack(), ChangeGroup()
    group.begin("a script")
    assert len(group.id or "") == 32
    for pdo in (TPDO1, TPDO2):
        contents.begin(group, timed(pdo, 0, 5), 5)
        contents.carried_out()
        assert contents.in_hand is None
    assert [change.label for change in contents.plan.changes] == ["TPDO1", "TPDO2"]
    group.begin("another one")
    contents.begin(group, timed(TPDO2, 5, 6), 5)
    assert contents.plan == timed(TPDO2, 5, 6)
