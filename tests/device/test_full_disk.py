"""What stands around a change where the disk takes nothing more: nothing is begun, and what is over stays over."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dvtcli.device.change.change_group import ChangeGroup
from dvtcli.device.change.change_guard import ChangeGuard
from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.plan_document import Identity
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.errors import JournalKept, SafetyRefusal

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size")
IDENTITY: Identity = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
TOO_LARGE = os.strerror(errno.EFBIG)
Keep = Callable[..., ChangeGuard]


def plan(index: int = 0x1017) -> Plan:
    return Plan(5, (ValueChange(Step(index, 0, b"\0\0", b"\1\0", "write")),))


@contextmanager
def files_end_at(limit: int) -> Iterator[None]:
    """No file grows beyond *limit* bytes."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def warned() -> list[str]:
    return []


@pytest.fixture
def keep(tmp_path: Path, warned: list[str]) -> Iterator[Keep]:
    """Keepers of node 5, which warn into `warned`; what they hold is let go at the end."""
    kept: list[ChangeGuard] = []

    def make(name: str = "state", group: ChangeGroup | None = None) -> ChangeGuard:
        guard = ChangeGuard(
            tmp_path / name, tmp_path / "locks", "can0", 5, warn=warned.append, group=group or ChangeGroup()
        )
        kept.append(guard)
        return guard

    yield make
    for guard in kept:
        guard.lock.release()


def begin(guard: ChangeGuard, index: int = 0x1017) -> None:
    guard.begin(plan(index), IDENTITY, None, dict)


def after_one_change(guard: ChangeGuard) -> None:
    """A whole of which one change was made."""
    begin(guard)
    guard.own_journal.carried_out()
    guard.own_journal.end()


def whole_of(name: str = "set-up.dvt") -> ChangeGroup:
    whole = ChangeGroup()
    whole.begin(name)
    return whole


def test_without_a_journal_nothing_is_begun(keep: Keep, tmp_path: Path) -> None:
    one = keep()
    begin(one)
    one.own_journal.end()
    with files_end_at(0), pytest.raises(SafetyRefusal) as caught:
        begin(one)
    assert caught.value.text == f"the journal of node 5 cannot be kept: {TOO_LARGE}"
    assert caught.value.place == str(tmp_path / "state"), "the system names no file"
    assert not one.own_journal.path.exists()
    begin(one)
    assert one.own_journal.path.exists()


#: in a folder of so long a name the lock, which names the journal, takes more room than the journal
LONG = "/".join(["x" * 250] * 8)


def test_a_journal_that_the_lock_cannot_name_is_removed_again(keep: Keep) -> None:
    one = keep(LONG)
    begin(one)
    room = one.own_journal.path.stat().st_size + 50
    assert room < one.lock.path.stat().st_size
    one.own_journal.end()
    with files_end_at(room), pytest.raises(SafetyRefusal, match="cannot be kept"):
        begin(one)
    assert not one.own_journal.path.exists()


def test_the_journal_of_what_was_made_before_stays_where_the_next_change_cannot_begin(keep: Keep) -> None:
    one = keep("state", whole_of())
    after_one_change(one)
    held = one.own_journal.path.read_text("utf-8")
    with files_end_at(0), pytest.raises(SafetyRefusal, match="cannot be kept"):
        begin(one, 0x1006)
    assert one.own_journal.path.read_text("utf-8") == held
    assert one.own_journal.is_open(one.own_journal.path), "no change is in hand: the whole can go on, or end"
    one.own_journal.end_group()
    assert not one.own_journal.path.exists()
    assert not one.own_journal.is_open(one.own_journal.path)


def test_a_journal_that_is_gone_is_gone_though_the_lock_still_names_it(keep: Keep, warned: list[str]) -> None:
    one = keep()
    begin(one)
    with files_end_at(0):
        one.own_journal.end()
    assert not one.own_journal.path.exists()
    assert warned == [f"the state folder takes nothing more ({TOO_LARGE}): {one.lock.path}"]


def test_one_that_was_recovered_elsewhere_is_gone_too(keep: Keep, warned: list[str]) -> None:
    first, second = keep(), keep("elsewhere")
    begin(first)
    first.lock.release()
    found = second.interrupted_journal()
    assert found is not None
    second.lock.take()
    second.journals.folder.mkdir(parents=True)
    with files_end_at(0):
        second.delete_journal(found)
    assert not found.path.exists()
    assert len(warned) == 1


def test_a_group_that_cannot_be_ended_is_said_with_the_file_in_the_way(keep: Keep) -> None:
    whole = whole_of()
    one = keep("state", whole)
    after_one_change(one)
    marker = one.journals.folder / f"{whole.id}.whole"
    marker.unlink()
    marker.mkdir()
    with pytest.raises(JournalKept) as caught:
        one.own_journal.complete_group()
    assert caught.value.place == str(one.own_journal.path)


def test_a_store_that_cannot_be_remembered_is_said(tmp_path: Path) -> None:
    said: list[str] = []
    history = ChangeHistory(tmp_path / "state" / "changes", "can0", said.append)
    history.add(plan(), IDENTITY)
    with files_end_at(0):
        history.was_stored(5, IDENTITY, ["1017:00"])
    assert said == [f"it is stored, but cannot be marked as stored: {TOO_LARGE}"]
    assert [one.stored for one in history.all_of(5, IDENTITY)] == [frozenset()]


@pytest.mark.parametrize("taken", [0, 1, 40])
def test_a_disk_that_takes_a_part_of_a_lock_s_note_leaves_the_one_before(
    keep: Keep, tmp_path: Path, taken: int
) -> None:
    guard = keep()
    guard.take_lock()
    guard.lock.note(tmp_path / "first.json")
    held = guard.lock.path.read_bytes()
    with files_end_at(len(held) + taken), pytest.raises(OSError, match=TOO_LARGE):
        guard.lock.note(tmp_path / ("x" * 100))
    assert guard.lock.path.read_bytes() == held
    assert guard.lock.noted() == tmp_path / "first.json"
    guard.lock.note(None)
    assert guard.lock.noted() is None
