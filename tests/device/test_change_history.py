"""What is remembered of changes, in its file: what a damaged one says, and whose change it was."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.journal import MOST_BYTES
from dvtcli.device.change.plan_document import Identity
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.errors import InputFileError

IDENTITY: Identity = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}


def plan(node_id: int = 5, value: int = 1, size: int = 2) -> Plan:
    data = bytes([value]) * size
    return Plan(node_id, (ValueChange(Step(0x2000, 0, bytes(size), data, "write")),))


#: what is written to put such a plan back
BACK = Plan(5, (ValueChange(Step(0x2000, 0, bytes([1, 1]), bytes(2), "write")),))


def values(history: ChangeHistory, selected: int | None = None, node_id: int = 5) -> list[int]:
    """The first byte of what each remembered change of the node wrote, oldest first."""
    return [one.plan.steps[0].after[0] for one in history.entries(node_id, IDENTITY, selected)]


Spoil = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda history: history.update(schema="dvtcli.past/2"), "it does not say dvtcli.past/1"),
        (lambda history: history.update(changes={}), "it lists no changes"),
        (lambda history: history["changes"][0].update(node=128), "node is 128, expected 1..127"),
        (lambda history: history["changes"][0].update(selected=0), "selected is 0, expected 1..127"),
        (lambda history: history["changes"][0].update(selected=128), "selected is 128, expected 1..127"),
        (lambda history: history["changes"][0].update(selected=True), "selected is True, expected 1..127"),
        (lambda history: history["changes"][0].update(selected="5"), "selected is '5', expected 1..127"),
    ],
)
def test_a_damaged_file_says_where_and_why(tmp_path: Path, spoil: Spoil, why: str) -> None:
    history = ChangeHistory(tmp_path, "can0")
    history.add(plan(), IDENTITY)
    path = history.path(5, IDENTITY)
    document = json.loads(path.read_text("utf-8"))
    spoil(document)
    path.write_text(json.dumps(document), "utf-8")
    with pytest.raises(InputFileError) as caught:
        history.newest(5, IDENTITY)
    assert (caught.value.place, caught.value.why) == (str(path), why)
    assert history.tops(None) == [], "whoever asks about every device is not stopped by one of them"


@pytest.mark.parametrize("text", ["[]", "7", "null", "{", '{"schema": "dvtcli.past/1"}', "[" * 100_000])
def test_what_is_no_such_file_is_said_and_not_used(tmp_path: Path, text: str) -> None:
    history = ChangeHistory(tmp_path, "can0")
    history.path(5, IDENTITY).write_text(text, "utf-8")
    with pytest.raises(InputFileError, match="does not contain the changes"):
        history.entries(5, IDENTITY)


def test_a_file_that_cannot_be_opened_is_said(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "can0")
    history.path(5, IDENTITY).mkdir()
    with pytest.raises(InputFileError) as caught:
        history.newest(5, IDENTITY)
    assert "directory" in (caught.value.why or "")


@pytest.mark.parametrize("selected", [None, 1, 127])
def test_the_node_that_a_change_was_made_from_is_remembered(tmp_path: Path, selected: int | None) -> None:
    ChangeHistory(tmp_path, "can0", selected=selected).add(plan(), IDENTITY)
    newest = ChangeHistory(tmp_path, "can0").newest(5, IDENTITY)
    assert newest is not None
    assert newest.selected == selected


def test_a_change_is_meant_from_its_own_node_and_from_where_it_was_made_as_far_back_as_all_are(tmp_path: Path) -> None:
    for value, selected in enumerate((7, None, 7, 7), 1):
        ChangeHistory(tmp_path, "can0", selected=selected).add(plan(value=value), IDENTITY)
    history = ChangeHistory(tmp_path, "can0")
    assert values(history) == values(history, 5) == [1, 2, 3, 4]
    assert values(history, 7) == [3, 4], "what lies behind one that was not made from there would be undone out of turn"
    assert values(history, 9) == []
    assert [len(history.tops(selected)) for selected in (None, 5, 7, 9)] == [1, 1, 1, 0]


def test_the_newest_of_each_device_of_this_bus_comes_first(tmp_path: Path) -> None:
    """A bus whose name begins like another one's is another bus."""
    for bus, node_id in (("can0", 5), ("can0", 9), ("can0-b", 7), ("can0", 5), ("can0", 8)):
        ChangeHistory(tmp_path, bus).add(plan(node_id), IDENTITY)
    history = ChangeHistory(tmp_path, "can0")
    assert [one.plan.node_id for one in history.tops(None)] == [8, 5, 9]
    newest = history.newest_of_all()
    assert newest is not None
    assert newest.plan.node_id == 8
    moved = history.moved(8, IDENTITY)
    assert moved is not None
    assert moved.plan.node_id == 5


def test_what_is_put_back_is_forgotten_and_nothing_else(tmp_path: Path) -> None:
    first, second = ChangeHistory(tmp_path, "can0"), ChangeHistory(tmp_path, "can0")
    first.add(plan(value=1), IDENTITY, "one")
    second.add(plan(value=2), IDENTITY)
    second.add(plan(9, 3), IDENTITY)
    second.add(plan(value=4), IDENTITY, "four")
    second.add(plan(value=5), IDENTITY)
    second.drop_own(1, BACK)
    assert values(second) == [1, 2, 4]
    second.drop(5, IDENTITY, ["four"])
    assert values(second) == [1, 2], "as `recover` does"
    second.drop_own(3, BACK)
    assert (values(second), values(second, node_id=9)) == ([1], [])
    first.drop_entries(first.entries(5, IDENTITY), BACK)
    assert values(first) == []


def test_dropping_makes_no_file(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "can0")
    history.drop(5, IDENTITY, ["one"])
    assert list(tmp_path.iterdir()) == []
    history.add(plan(), IDENTITY)
    written = history.path(5, IDENTITY).stat()
    history.drop(5, IDENTITY, [])
    assert history.path(5, IDENTITY).stat() == written, "nothing to drop: the file is ignored"


def test_a_file_of_the_largest_size_is_read_and_one_above_is_not(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "can0")
    history.add(plan(), IDENTITY)
    path = history.path(5, IDENTITY)
    text = path.read_text("utf-8")
    path.write_text(text.ljust(MOST_BYTES), "utf-8")
    assert values(history) == [1]
    path.write_text(text.ljust(MOST_BYTES + 1), "utf-8")
    with pytest.raises(InputFileError):
        history.newest(5, IDENTITY)


@pytest.mark.parametrize(
    ("sizes", "left"),
    [
        ((250_000, 250_000, 250_000, 250_000), [1, 2, 3, 4]),
        ((250_000, 250_000, 250_000, 250_000, 250_000), [4, 5]),
        ((250_000, 250_000, 250_000, 562_500), [3, 4]),
        ((750_000, 750_000), [2]),
        ((250_000, MOST_BYTES // 4), []),  # it alone is too large
    ],
)
def test_what_would_be_too_large_to_be_read_loses_its_older_half(
    tmp_path: Path, sizes: tuple[int, ...], left: list[int]
) -> None:
    history = ChangeHistory(tmp_path, "can0")
    for value, size in enumerate(sizes, 1):
        history.add(plan(value=value, size=size), IDENTITY)
    assert values(history) == left


def test_fifty_changes_are_remembered(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "can0")
    for value in range(52):
        history.add(plan(value=value), IDENTITY)
    assert values(history) == list(range(2, 52))


def test_a_file_is_named_by_bus_identity_and_node(tmp_path: Path) -> None:
    path = ChangeHistory(tmp_path, "can0").path(
        5, {"vendor": 0x19A, "product": 2, "revision": None, "serial": 0xFFFF_FFFE}
    )
    assert path == tmp_path / "can0-0000019A-00000002-none-FFFFFFFE-node5.json"


@pytest.mark.parametrize(
    ("serial", "known"), [(None, False), (0, False), (1, True), (0xFFFF_FFFE, True), (0xFFFF_FFFF, False)]
)
def test_a_device_with_another_node_id_is_known_by_a_serial_number_of_its_own(
    tmp_path: Path, serial: int | None, known: bool
) -> None:
    history = ChangeHistory(tmp_path, "can0")
    history.add(plan(9), IDENTITY | {"serial": serial})
    assert (history.moved(5, IDENTITY | {"serial": serial}) is not None) == known


def test_a_damaged_file_is_kept_aside_and_said_and_the_next_change_is_remembered(tmp_path: Path) -> None:
    said: list[str] = []
    history = ChangeHistory(tmp_path, "can0", said.append)
    history.path(5, IDENTITY).write_text("rubbish", "utf-8")
    history.add(plan(value=7), IDENTITY)
    assert values(history) == [7]
    (aside,) = tmp_path.glob("*.damaged-*")
    assert aside.read_text("utf-8") == "rubbish"
    assert said == [f"{history.path(5, IDENTITY)} does not contain the changes: it is kept as {aside}"]


def test_what_cannot_be_written_is_said_and_has_its_place_among_the_session_s_changes(tmp_path: Path) -> None:
    said: list[str] = []
    folder = tmp_path / "changes"
    history = ChangeHistory(folder, "can0", said.append)
    history.add(plan(value=1), IDENTITY)
    held = history.entries(5, IDENTITY)
    folder.rename(tmp_path / "away")
    folder.write_text("in the way", "utf-8")
    history.add(plan(value=2), IDENTITY)
    history.drop_own(1, BACK)
    history.add(plan(value=2), IDENTITY)
    history.drop_entries(held, BACK)
    folder.unlink()
    (tmp_path / "away").rename(folder)
    undone = "it is rolled back, but the history for undo cannot be written: Not a directory"
    refused = f"{folder} is not used: it is a file, not a folder"
    assert said == [*2 * [f"the change is done, but cannot be saved for a later undo: {refused}"], undone]
    history.drop_own(1, BACK)
    assert values(history) == [1], "the one that is forgotten is the one that was never written"
    history.drop_own(1, BACK)
    assert values(history) == []


def test_what_is_put_back_after_it_was_stored_is_remembered_for_the_next_store_only(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "can0")
    for value in (1, 2):
        history.add(plan(value=value), IDENTITY)
    history.was_stored(5, IDENTITY, ["2000:00"])
    history.add(plan(value=3), IDENTITY)
    history.drop_own(1, BACK)
    assert [one.undoes for one in history.all_of(5, IDENTITY)] == [False, False], "what it put back had not been stored"
    history.drop_own(1, BACK)
    undone = history.all_of(5, IDENTITY)[-1]
    assert (undone.undoes, undone.plan, undone.stored) == (True, BACK, frozenset())
    newest = history.newest(5, IDENTITY)
    assert (values(history), newest) == ([1], history.entries(5, IDENTITY)[0]), "no `undo` reverts an `undo`"
    assert history.tops(None) == [newest]
    history.drop_entries(history.entries(5, IDENTITY), Plan(5, ()))
    assert history.all_of(5, IDENTITY) == [undone]
    assert (history.newest(5, IDENTITY), history.newest_of_all(), history.moved(7, IDENTITY)) == (None, None, None)
    history.was_stored(5, IDENTITY, ["2000:00"])
    assert history.all_of(5, IDENTITY) == []


def test_what_is_put_back_under_another_node_id_is_remembered_there(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "can0")
    history.add(plan(), IDENTITY)
    history.was_stored(5, IDENTITY, ["2000:00"])
    history.drop_entries(history.entries(5, IDENTITY), Plan(7, BACK.changes))
    assert history.all_of(5, IDENTITY) == []
    assert [one.undoes for one in history.all_of(7, IDENTITY)] == [True]


def clock_set(history: ChangeHistory, node_id: int, when: str) -> None:
    """What the file of a node says was made when the computer's clock showed *when*."""
    path = history.path(node_id, IDENTITY)
    document = json.loads(path.read_text("utf-8"))
    document["changes"][-1]["when"] = when
    path.write_text(json.dumps(document), "utf-8")


@pytest.mark.parametrize("seed", range(4))
def test_the_order_of_changes_is_no_clock_s(tmp_path: Path, seed: int) -> None:
    """A clock without a battery: each change is made at another time, the last one is the last one."""
    random, made = Random(seed), list[int]()
    for _ in range(12):
        node_id = random.choice((5, 9, 12))
        history = ChangeHistory(tmp_path / "changes", "can0")  # another process each
        history.add(plan(node_id), IDENTITY)
        clock_set(history, node_id, f"20{random.randrange(70):02}-01-01T00:00:00+00:00")
        made.append(node_id)
        assert [one.plan.node_id for one in history.tops(None)] == list(dict.fromkeys(reversed(made)))
        newest = history.newest_of_all()
        assert newest is not None
        assert newest.plan.node_id == node_id


@pytest.mark.parametrize("said", [None, "", "7", "x" * 19 + "\n"])
def test_a_counter_that_is_gone_or_damaged_goes_on_from_what_is_remembered(tmp_path: Path, said: str | None) -> None:
    history = ChangeHistory(tmp_path / "changes", "can0")
    for node_id in (5, 9, 5):
        history.add(plan(node_id), IDENTITY)
    (count,) = history.folder.glob("*.count")
    count.unlink()
    if said is not None:
        count.write_text(said)
        count.chmod(0o600)
    history.add(plan(9), IDENTITY)
    assert [(one.plan.node_id, one.number) for one in history.tops(None)] == [(9, 4), (5, 3)]


def test_what_an_earlier_version_kept_without_a_number_came_first(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path / "changes", "can0")
    for node_id in (5, 9):
        history.add(plan(node_id), IDENTITY)
        path = history.path(node_id, IDENTITY)
        document = json.loads(path.read_text("utf-8"))
        del document["changes"][0]["number"]
        path.write_text(json.dumps(document), "utf-8")
    assert [one.plan.node_id for one in history.tops(None)] == [9, 5], "by the time that they say"
    history.add(plan(5), IDENTITY)
    clock_set(history, 5, "1970-01-01T00:00:00+00:00")
    assert [one.plan.node_id for one in history.tops(None)] == [5, 9]
