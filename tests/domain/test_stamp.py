"""A stamp is a valid date and time, is recognised without any memory, and is taken for nobody else's."""

from __future__ import annotations

from datetime import date, timedelta

from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.network.network_plan import phases
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.domain.store import Stamp
from tests.harness.sample import heavy

DAY_MS = 24 * 60 * 60 * 1000
DATES, TIMES = st.integers(0, 0xFFFF_FFFF), st.integers(0, 0xFFFF_FFFF)


@given(st.text())
def test_a_stamp_of_anything_is_a_date_and_a_time_that_is_recognised(words: str) -> None:
    made = Stamp.of(words)
    assert made == Stamp.of(words)
    assert made.is_own
    assert not made.is_foreign
    assert str(made).startswith(str(date(1984, 1, 1) + timedelta(made.days)))
    assert date(1984, 1, 1) + timedelta(made.days) > date(2163, 1, 1)
    assert 0 <= made.ms < DAY_MS
    assert [int.from_bytes(made.data(sub_index), "little") for sub_index in (1, 2)] == [made.days, made.ms]


@given(st.text(), st.text())
def test_other_words_have_another_stamp(one: str, other: str) -> None:
    assert (Stamp.of(one) == Stamp.of(other)) is (one == other)


@given(st.text(), st.integers(1, DAY_MS - 1))
def test_another_time_of_that_day_is_hardly_ever_ours(words: str, later: int) -> None:
    made = Stamp.of(words)
    moved = Stamp(made.days, (made.ms + later) % DAY_MS)
    assert moved.is_foreign or moved.ms % 9973 != made.ms % 9973 or (moved.ms - made.ms) % 9973 == 0


@given(st.integers(0, 65_535), TIMES)
def test_no_date_before_2163_is_ours(days: int, ms: int) -> None:
    found = Stamp(days, ms)
    assert not found.is_own
    assert found.is_foreign is bool(days or ms)


@given(DATES, TIMES)
def test_whatever_a_device_holds_can_be_shown(days: int, ms: int) -> None:
    assert str(Stamp(days, ms))


@heavy
def test_one_in_9973_times_of_a_day_is_ours() -> None:
    own = sum(Stamp(1_000_000, ms).is_own for ms in range(DAY_MS // 100))
    assert own == DAY_MS // 100 // 9973 + 1 or own == DAY_MS // 100 // 9973


def test_a_stamp_goes_first_to_0_and_comes_last() -> None:
    old, new = Stamp.of("old"), Stamp.of("new")
    value = ValueChange(Step(0x1017, 0, b"\0\0", b"\1\0", "write"))
    stamps = [ValueChange(Step(0x1020, sub, old.data(sub), new.data(sub), "stamp")) for sub in (1, 2)]
    plan = Plan(1, (value, *stamps))
    made = [
        [(step.object, step.before, step.after) for part in phase for step in part.steps] for phase in phases([plan])
    ]
    nothing = bytes(4)
    assert made == [
        [("1020:01", old.data(1), nothing), ("1020:02", old.data(2), nothing)],
        [],
        [("1017:00", b"\0\0", b"\1\0")],
        [],
        [("1020:01", nothing, new.data(1)), ("1020:02", nothing, new.data(2))],
    ]
    assert sum(len(phase) for phase in made) == len(plan)
