"""What stands around a change on disk, seen by a second dvtcli that keeps its journals elsewhere."""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.change.change_group import GroupMember
from dvtcli.device.change.change_guard import ChangeGuard, who_else
from dvtcli.device.change.journal import read_journal
from dvtcli.device.change.lock import NodeLock
from dvtcli.device.change.plan_document import Identity
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.errors import InputFileError, SafetyRefusal
from tests.journals import journal_document
from tests.laws.bench import DirectSdo, booted
from tests.posix import SIGALRM

IDENTITY: Identity = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
PLAN = Plan(5, (ValueChange(Step(0x1017, 0, b"\0\0", b"\1\0", "write")),))


Keep = Callable[..., ChangeGuard]


@pytest.fixture
def keep(tmp_path: Path) -> Iterator[Keep]:
    """Keepers with one folder of locks; what they hold is let go at the end."""
    kept: list[ChangeGuard] = []

    def make(name: str = "state") -> ChangeGuard:
        kept.append(ChangeGuard(tmp_path / name, tmp_path / "locks", "socketcan:can0", 5))
        return kept[-1]

    yield make
    for guard in kept:
        guard.lock.release()


def test_the_lock_names_its_holder_and_the_journal(keep: Keep, tmp_path: Path) -> None:
    one = keep()
    one.begin(PLAN, IDENTITY, 127, dict)
    journal = tmp_path / "state" / "journals" / "socketcan_can0-5.json"
    assert journal.exists()
    assert one.lock.path.read_text().splitlines()[:2] == [str(os.getpid()), str(journal)]
    assert one.lock.noted() == journal


def test_a_journal_in_another_folder_is_found_through_the_lock(keep: Keep, tmp_path: Path) -> None:
    first, second = keep(), keep("elsewhere")
    first.begin(PLAN, IDENTITY, 127, dict)
    assert second.interrupted_journal() is None  # its holder is at work
    first.lock.release()  # as the system does where it was killed
    found = second.interrupted_journal()
    assert found is not None
    assert (found.path, found.plan, found.identity) == (first.journals.path(5), PLAN, IDENTITY)
    assert (found.nmt_state, found.bus) == (127, "socketcan:can0")
    with pytest.raises(SafetyRefusal) as caught:
        second.lock_or_refuse()
    assert caught.value.place == str(first.journals.path(5))
    second.journals.folder.mkdir(parents=True)
    second.delete_journal(found)
    assert not found.path.exists()
    assert second.lock.noted() is None


def test_a_change_that_ended_leaves_nothing_open(keep: Keep, tmp_path: Path) -> None:
    one = keep()
    one.begin(PLAN, IDENTITY, None, dict)
    one.own_journal.end()
    assert one.lock.noted() is None
    assert one.unfinished_journal() is None
    assert one.lock.path.read_text().splitlines()[:2] == [str(os.getpid()), ""]


def test_one_holder_at_a_time(keep: Keep, tmp_path: Path) -> None:
    first, second = keep(), keep("elsewhere")
    assert first.lock.is_free()
    assert not first.lock.held
    assert second.lock.is_free(), "who only looked holds nothing"
    first.lock.take()
    first.lock.take()
    assert first.lock.is_free()
    assert second.lock.is_free() is False
    with pytest.raises(SafetyRefusal, match=f"process {os.getpid()}"):
        second.lock.take()
    first.lock.release()
    second.lock.take()
    second.lock.release()


def test_a_refusal_says_who_and_since_when_and_how_long_was_waited(keep: Keep) -> None:
    first, second = keep(), keep("elsewhere")
    first.lock.command = lambda: "map"
    first.lock.take()
    since = first.lock.path.read_text().splitlines()[2]
    with pytest.raises(SafetyRefusal) as caught:
        second.lock.take(0.05)
    refusal = caught.value
    assert refusal.text == f"another dvtcli (process {os.getpid()}) is changing node 5 on socketcan:can0"
    assert refusal.why == f"its `map` holds the node's lock since {since[11:19]} UTC, and was waited for 0.05 s"
    assert refusal.hint is not None
    assert f"process {os.getpid()}" in typed(refusal.hint)
    first.lock.release()
    second.lock.take()
    second.lock.release()


def test_one_that_is_done_in_a_moment_is_waited_for(keep: Keep) -> None:
    first, second = keep(), keep("elsewhere")
    first.lock.take()
    timer = threading.Timer(0.05, first.lock.release)
    timer.start()
    second.lock.take(60)
    timer.join()
    assert second.lock.held


def test_who_wrote_meanwhile_is_known_and_who_only_looked_is_not(keep: Keep) -> None:
    one, other = keep(), keep("elsewhere")
    other.lock.command = lambda: "set"
    for guard in (one, other, one):  # both have held it, and wrote nothing
        guard.lock.take()
        guard.lock.release()
    assert one.lock.meanwhile is None
    one.begin(PLAN, IDENTITY, None, dict)
    one.own_journal.end()
    one.lock.release()
    other.begin(PLAN, IDENTITY, None, dict)
    other.own_journal.end()
    other.lock.release()
    one.lock.take()
    assert one.lock.meanwhile is not None
    assert (one.lock.meanwhile.process, one.lock.meanwhile.command) == (str(os.getpid()), "set")
    assert f"another dvtcli (process {os.getpid()}, `set`, " in who_else(one)
    one.lock.release()
    third = keep("third")
    third.lock.take()
    assert third.lock.meanwhile is None, "nobody wrote after it had held the lock"
    assert who_else(third) == who_else(None) == "it restarted, or another client wrote to it"


def test_who_recovers_writes_and_who_finds_a_journal_does_not(keep: Keep) -> None:
    one, other, third = keep(), keep(), keep("elsewhere")
    one.begin(PLAN, IDENTITY, None, dict)
    one.own_journal.end()
    one.lock.release()
    other.begin(PLAN, IDENTITY, None, dict)
    other.lock.release()  # killed
    third.lock.command = lambda: "pdo"
    assert third.interrupted_journal() is not None
    assert one.lock.is_free()
    assert one.lock.meanwhile is not None
    assert one.lock.meanwhile.command == ""
    third.lock.command = lambda: "recover"
    found = third.interrupted_journal()
    assert found is not None
    third.lock.take()
    third.journals.folder.mkdir(parents=True)
    third.delete_journal(found)
    third.lock.release()
    assert one.lock.is_free()
    assert one.lock.meanwhile.command == "recover"


def test_what_the_lock_s_file_says_is_cut_short(keep: Keep) -> None:
    one, other = keep(), keep("elsewhere")
    one.lock.command = lambda: "x" * 200
    one.lock.take()
    assert one.lock.path.read_text().splitlines()[3] == "x" * 80
    one.lock.path.write_text("1" * 50 + "\n\n" + "2" * 50 + "\n" + "3" * 100 + "\n")
    with pytest.raises(SafetyRefusal) as caught:
        other.lock.take(0)
    assert f"(process {'1' * 20})" in caught.value.text
    assert f"its `{'3' * 80}` holds" in str(caught.value.why)
    one.lock.path.write_text("")
    with pytest.raises(SafetyRefusal) as caught:
        other.lock.take(0)
    assert "(process ?)" in caught.value.text
    assert caught.value.why == "it holds the node's lock, and was waited for 0 s"


def test_the_backup_is_made_once_and_read_by_its_owner_only(keep: Keep, tmp_path: Path) -> None:
    said: list[str] = []
    one = keep()
    one.report = said.append
    reads: list[int] = []
    for _ in range(2):
        one.begin(PLAN, IDENTITY, None, lambda: reads.append(1) or {})
        one.own_journal.end()
    (backup,) = (tmp_path / "state" / "backups").iterdir()
    assert reads == [1]
    assert said == [f"backup of node 5: {backup}"]
    for path in (backup, one.lock.path.parent, backup.parent):
        assert not path.stat().st_mode & 0o077


def test_a_backup_holds_every_pdo_and_disables_those_it_can(keep: Keep, tmp_path: Path) -> None:
    sdo = DirectSdo(booted())
    pdos = {pdo: read_pdo(sdo, pdo) for pdo in (Pdo.parse("tpdo1"), Pdo.parse("tpdo2"))}
    for name, fixed in (("state", set()), ("elsewhere", {Pdo.parse("tpdo2")})):
        one = keep(name)
        if fixed:
            one.is_fixed = fixed.__contains__
        one.begin(PLAN, IDENTITY, None, lambda: pdos)
        one.own_journal.end()
        one.lock.release()
        (backup,) = (tmp_path / name / "backups").iterdir()
        lines = backup.read_text().splitlines()
        assert [line for line in lines if line.startswith("disable")] == [f"disable tpdo1{'' if fixed else ' tpdo2'}"]
        assert [line.split()[:2] for line in lines if line.startswith("map")] == [["map", "tpdo1"], ["map", "tpdo2"]]


def test_the_folder_of_locks_is_made_with_its_parents(tmp_path: Path) -> None:
    lock = NodeLock(tmp_path / "a" / "b" / "locks", "socketcan:can0", 5)
    lock.take()
    lock.release()
    assert lock.path.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size")
def test_a_disk_that_takes_nothing_does_not_take_the_note_of_an_open_journal(tmp_path: Path) -> None:
    import resource

    lock, note = NodeLock(tmp_path / "state" / "locks", "socketcan:can0", 5), tmp_path / "elsewhere.json"
    lock.take()
    lock.note(note)
    lock.release()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        with pytest.raises(OSError, match="too large"):
            lock.take()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not lock.held
    assert lock.noted() == note


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no modes of this kind")
def test_in_a_folder_that_others_can_write_nothing_is_made(tmp_path: Path) -> None:
    state = tmp_path / "state"
    state.mkdir()
    state.chmod(0o777)
    with pytest.raises(SafetyRefusal, match="everybody can write it"):
        NodeLock(state / "locks", "socketcan:can0", 5).take()
    assert list(state.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no timer that interrupts")
def test_who_waits_for_the_lock_can_be_interrupted(keep: Keep) -> None:
    import signal

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    first, second = keep(), keep("elsewhere")

    def waits_for_long() -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        second.lock.take(60)

    first.lock.take()
    before = signal.signal(SIGALRM, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):  # also where it comes at once
            waits_for_long()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(SIGALRM, before)
    assert not second.lock.held
    assert first.lock.path.read_text().splitlines()[0] == str(os.getpid())


def test_who_wrote_meanwhile_is_known_though_not_since_when(keep: Keep) -> None:
    one = keep()
    one.lock.take()
    one.lock.release()
    one.lock.path.write_text("1\n\n\n\n77\n\n\n")
    one.lock.take()
    assert str(one.lock.meanwhile) == "process 77, ? UTC"


def test_what_is_set_aside_is_set_aside_by_the_holder_of_the_lock(keep: Keep) -> None:
    first, second = keep(), keep("elsewhere")
    first.begin(PLAN, IDENTITY, None, dict)
    first.lock.release()
    aside = second.set_aside(first.journals.path(5), "discarded")
    assert second.lock.held
    assert (aside.exists(), second.lock.noted(), second.unfinished_journal()) == (True, None, None)


def test_what_was_recovered_elsewhere_is_not_noted_any_more_beside_one_that_does_not_count(keep: Keep) -> None:
    first, second = keep(), keep("elsewhere")
    first.begin(PLAN, IDENTITY, None, dict)
    first.lock.release()
    found = second.interrupted_journal()
    assert found is not None
    second.lock.take()
    second.journals.write(PLAN, IDENTITY, None, GroupMember("5f"))  # of a group that is complete
    second.delete_journal(found)
    assert second.journals.path(5).exists()
    assert (second.lock.noted(), second.unfinished_journal()) == (None, None)


def test_where_one_of_ours_is_open_the_lock_says_what_it_said(keep: Keep) -> None:
    first, second = keep(), keep("elsewhere")
    first.begin(PLAN, IDENTITY, None, dict)
    first.lock.release()
    found = second.interrupted_journal()
    assert found is not None
    second.lock.take()
    own = second.journals.write(Plan(5, PLAN.changes * 2), IDENTITY, None)
    second.lock.note(own)
    second.delete_journal(found)
    assert second.lock.noted() == second.unfinished_journal() == own


@pytest.mark.parametrize("name", ["letter.json", "socketcan_can0-6.json", "socketcan_can0-5.txt", "passwd"])
def test_a_lock_that_names_another_file_than_a_journal_of_its_node_leaves_that_alone(
    keep: Keep, tmp_path: Path, name: str
) -> None:
    """Nothing that a lock says is renamed or removed but a journal of that very node and bus."""
    one, other = keep(), tmp_path / "letters" / name
    other.parent.mkdir()
    other.write_text("dear reader")
    one.take_lock()
    one.lock.note(other)
    assert one.unfinished_journal() is None
    one.begin(PLAN, IDENTITY, 127, dict)
    one.own_journal.end()
    assert other.read_text() == "dear reader"


@pytest.mark.parametrize("whole", ["../letter", "/etc/passwd", "a/../../letter", "", "."])
def test_a_journal_that_names_a_group_outside_its_folder_is_damaged(keep: Keep, whole: str) -> None:
    """The id is part of the name of a file that is removed at the end."""
    one = keep()
    one.begin(PLAN, IDENTITY, 127, dict)
    path = one.own_journal.path
    path.write_text(json.dumps({**journal_document(path), "whole": whole}))
    with pytest.raises(InputFileError) as caught:
        read_journal(path)
    assert caught.value.why == "the id of what it belongs to is malformed"
