"""What devices of one identity were found to want: kept by identity, and found out anew where the file does not say."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest

from dvtcli.device.change.plan_document import Identity
from dvtcli.device.habits import OFTEN_ENOUGH, Habit, Habits, name_of, read_habits
from dvtcli.domain.pdo import Direction

IDENTITY: Identity = {"vendor": 0x1E, "product": 0x0705_302D, "revision": None, "serial": 7}
TIMER = Habit((Direction.TPDO, 5), 0x0800_0022)


def found_out(folder: Path | None, times: int = OFTEN_ENOUGH) -> tuple[Habits, list[str]]:
    said: list[str] = []
    habits = Habits(folder, said.append)
    for time in range(times):
        assert habits.add(IDENTITY, TIMER) == time + 1
    return habits, said


def test_a_file_is_called_by_what_devices_of_one_kind_share() -> None:
    assert name_of(IDENTITY) == "0000001E-0705302D-none"
    assert name_of({**IDENTITY, "revision": 0x10000}) == "0000001E-0705302D-00010000"
    for less in ("vendor", "product"):
        assert name_of({**IDENTITY, less: None}) == ""


def test_a_later_process_knows_it_too_of_that_kind_of_device(tmp_path: Path) -> None:
    _, said = found_out(tmp_path / "state" / "habits")
    later = Habits(tmp_path / "state" / "habits")
    assert later.are_there
    assert later.off_first({**IDENTITY, "serial": 8}) == {(Direction.TPDO, 5)}
    assert later.off_first({**IDENTITY, "product": 8}) == frozenset()
    assert later.add(IDENTITY, TIMER) == OFTEN_ENOUGH + 1
    assert said == []


def test_a_later_process_knows_too_that_a_device_takes_no_pdo_while_it_runs(tmp_path: Path) -> None:
    running = Habit(None, 0x0800_0022)
    habits = Habits(tmp_path / "habits")
    for _ in range(OFTEN_ENOUGH):
        assert not Habits(tmp_path / "habits").is_pre_operational_wanted(IDENTITY)
        habits.add(IDENTITY, running)
    said: list[str] = []
    later = Habits(tmp_path / "habits", said.append)
    assert later.is_pre_operational_wanted({**IDENTITY, "serial": 8})
    assert not later.is_pre_operational_wanted({**IDENTITY, "product": 8})
    assert (later.off_first(IDENTITY), said) == (frozenset(), [])


def test_one_refusal_is_not_often_enough(tmp_path: Path) -> None:
    habits, _ = found_out(tmp_path / "state" / "habits", OFTEN_ENOUGH - 1)
    assert habits.off_first(IDENTITY) == frozenset()


def test_what_cannot_be_kept_is_said_and_known_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("no folder", "utf-8")
    habits, said = found_out(tmp_path / "state" / "habits")
    assert habits.off_first(IDENTITY) == {(Direction.TPDO, 5)}
    unread, *unwritten = said
    assert "is damaged" in unread
    assert len(unwritten) == OFTEN_ENOUGH
    assert all(text.startswith("the habits of this device cannot be saved: ") for text in unwritten)
    assert found_out(None)[1] == []


ROW = {"direction": "tpdo", "sub_index": 5, "abort": 0x0800_0022, "times": 3}


@pytest.mark.parametrize(
    ("document", "why"),
    [
        ([], "it does not say dvtcli.habits/2"),
        ({"schema": "dvtcli.habits/1", "refused": [ROW]}, "it does not say dvtcli.habits/2"),
        ({"refused": [ROW]}, "it does not say dvtcli.habits/2"),
        ({"schema": "dvtcli.habits/2", "refused": ROW}, "it names no refusals"),
        ({"schema": "dvtcli.habits/2", "refused": [7]}, "a refusal is malformed"),
        *(
            ({"schema": "dvtcli.habits/2", "refused": [{**ROW, key: value}]}, "a refusal is malformed")
            for key, value in [
                ("sub_index", 1), ("sub_index", 7), ("sub_index", True), ("sub_index", None), ("times", 0),
                ("times", 1_000_001), ("times", "3"), ("abort", -1), ("abort", 0x1_0000_0000),
            ]
        ),
        ({"schema": "dvtcli.habits/2", "refused": [{**ROW, "direction": "spdo"}]}, "'spdo' is not a valid Direction"),
        ({"schema": "dvtcli.habits/2", "refused": [], "operational": ROW}, "it names no refusals"),
        ({"schema": "dvtcli.habits/2", "refused": [], "operational": [7]}, "a refusal is malformed"),
        ({"schema": "dvtcli.habits/2", "refused": [], "operational": [{"abort": 5}]}, "a refusal is malformed"),
    ],
)  # fmt: skip
def test_a_file_that_does_not_say_is_told_and_found_out_anew(tmp_path: Path, document: object, why: str) -> None:
    said: list[str] = []
    (tmp_path / f"{name_of(IDENTITY)}.json").write_text(json.dumps(document), "utf-8")
    assert Habits(tmp_path, said.append).off_first(IDENTITY) == frozenset()
    (text,) = said
    assert why in text


@pytest.mark.parametrize(("key", "value"), [("sub_index", 2), ("sub_index", 6), ("abort", 0), ("abort", 0xFFFF_FFFF),
                                            ("times", 1), ("times", 1_000_000)])  # fmt: skip
def test_what_may_stand_in_a_file_is_taken(tmp_path: Path, key: str, value: int) -> None:
    row = {**ROW, key: value}
    path = tmp_path / "it.json"
    path.write_text(json.dumps({"schema": "dvtcli.habits/2", "refused": [row]}), "utf-8")
    sub_index, abort, times = (int(str(row[name])) for name in ("sub_index", "abort", "times"))
    assert read_habits(path) == Counter({Habit((Direction.TPDO, sub_index), abort): times})
