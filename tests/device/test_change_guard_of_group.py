"""The journals of changes that stand or fall together, on one node and on several: when they count and when they go."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.change.change_group import ChangeGroup, GroupMember, Storing
from dvtcli.device.change.change_guard import ChangeGuard
from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.journal import Journal, read_journal
from dvtcli.device.change.plan_document import Identity
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.errors import JournalKept, SafetyRefusal
from tests.device.test_full_disk import files_end_at
from tests.journals import journal_document

IDENTITY: Identity = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
Keep = Callable[..., ChangeGuard]


def let_go(guard: ChangeGuard) -> None:
    guard.lock.release()


def plan(node_id: int, index: int) -> Plan:
    return Plan(node_id, (ValueChange(Step(index, 0, b"\0\0", b"\1\0", "write")),))


@pytest.fixture
def keep(tmp_path: Path) -> Iterator[Keep]:
    """Keepers of nodes that share one group, which has begun; what they hold is let go at the end."""
    kept: list[ChangeGuard] = []
    shared = ChangeGroup()
    shared.begin("set-up.dvt")

    def make(node_id: int = 5, name: str = "state", group: ChangeGroup = shared) -> ChangeGuard:
        guard = ChangeGuard(tmp_path / name, tmp_path / "locks", "can0", node_id, group=group)
        kept.append(guard)
        return guard

    yield make
    for guard in kept:
        guard.lock.release()


def make(guard: ChangeGuard, index: int, nmt_state: int | None = 5) -> None:
    """Begin a change, carry it out, and end it."""
    one = plan(guard.node_id, index)
    guard.begin(one, IDENTITY, nmt_state, dict)
    guard.own_journal.carried_out()
    guard.remember(one)
    guard.own_journal.end()


def journal(guard: ChangeGuard) -> Journal:
    return read_journal(guard.journals.path(guard.node_id))


def indices(guard: ChangeGuard) -> list[int]:
    """What the journal has to put back."""
    return [step.index for step in journal(guard).plan.steps]


def markers(guard: ChangeGuard) -> int:
    return len(list(guard.journals.folder.glob("*.whole")))


def test_the_journal_of_a_group_grows_with_each_change_and_counts_to_its_end(keep: Keep) -> None:
    one = keep()
    assert one.lock_or_refuse()
    make(one, 0x2000)
    make(one, 0x2001, 127)
    held = journal(one)
    assert indices(one) == [0x2000, 0x2001]
    assert (held.nmt_state, held.member.group_id, held.member.name) == (5, one.group.id, "set-up.dvt")
    assert len(set(held.member.entries)) == 2
    assert markers(one) == 1
    assert not one.lock_or_refuse(), "its own journal does not stand in its way, and it has the lock"
    one.own_journal.complete_group()
    assert (one.unfinished_journal(), one.lock.noted(), markers(one)) == (None, None, 0)
    assert not one.journals.path(5).exists()


def test_a_change_that_is_undone_leaves_what_was_made_before_it(keep: Keep) -> None:
    one = keep()
    make(one, 0x2000)
    one.begin(plan(5, 0x2001), IDENTITY, 5, dict)
    assert indices(one) == [0x2000, 0x2001]
    with pytest.raises(SafetyRefusal, match="not finished yet") as caught:
        one.lock_or_refuse()  # while it is in hand, nobody knows what the device holds
    assert (
        typed(caught.value.hint)
        == f"`recover` rolls back to the old configuration, with the journal {one.journals.path(5)}"
    )
    one.own_journal.end()
    assert not one.lock_or_refuse()
    one.own_journal.note(plan(5, 0x2002))
    assert indices(one) == [0x2000, 0x2002]
    one.own_journal.end()
    make(one, 0x2003)
    assert indices(one) == [0x2000, 0x2003]


def test_a_group_of_several_nodes_ends_on_all_of_them_at_one_stroke(keep: Keep) -> None:
    one, other = keep(5), keep(7)
    make(one, 0x2000)
    make(other, 0x2000)
    assert [found.plan.node_id for found in one.journals.all_of(str(one.group.id))] == [5, 7]
    one.own_journal.complete_group()
    assert other.journals.path(7).exists()
    assert other.unfinished_journal() is None, "it is there, and counts no longer"
    other.own_journal.complete_group()
    assert not other.journals.path(7).exists()


def test_the_last_node_that_is_put_back_takes_the_marker_along(keep: Keep) -> None:
    one, other = keep(5), keep(7)
    make(one, 0x2000)
    make(other, 0x2000)
    one.own_journal.end_group()
    assert (markers(one), one.unfinished_journal(), other.unfinished_journal()) == (1, None, other.journals.path(7))
    one.own_journal.abandon_group()
    assert markers(one) == 1, "the other node waits for it"
    other.own_journal.end_group()
    assert (markers(one), other.unfinished_journal()) == (0, None)


def test_while_a_change_is_in_hand_the_group_is_not_over(keep: Keep) -> None:
    one = keep()
    make(one, 0x2000)
    one.begin(plan(5, 0x2001), IDENTITY, 5, dict)
    one.own_journal.end_group()
    assert indices(one) == [0x2000, 0x2001]


def test_a_group_that_changed_nothing_leaves_nothing(keep: Keep) -> None:
    one = keep()
    one.own_journal.complete_group()
    assert one.unfinished_journal() is None
    one.begin(plan(5, 0x2000), IDENTITY, 5, dict)
    assert markers(one) == 1
    one.own_journal.end()
    assert not one.journals.path(5).exists()
    one.own_journal.abandon_group()
    assert markers(one) == 0


def test_a_line_that_no_undo_reverts_is_on_disk_before_it_begins(keep: Keep) -> None:
    one = keep()
    one.own_journal.record_stores("store")
    assert one.unfinished_journal() is None, "nothing was changed: nothing to roll back"
    make(one, 0x2000)
    one.own_journal.record_stores("store")
    assert journal(one).member.final == "store"
    one.own_journal.record_stores("")
    make(one, 0x2001)
    assert journal(one).member.final == ""


def test_a_journal_of_another_group_stands_in_the_way(keep: Keep) -> None:
    one = keep()
    make(one, 0x2000)
    one.group.begin("another.dvt")
    with pytest.raises(SafetyRefusal, match="not finished yet"):
        one.lock_or_refuse()


def test_a_damaged_journal_says_what_closes_it(keep: Keep) -> None:
    one = keep()
    make(one, 0x2000)
    path = one.journals.path(5)
    path.write_text("{", "utf-8")
    one.group.begin("another.dvt")
    with pytest.raises(SafetyRefusal) as caught:
        one.lock_or_refuse()
    assert (
        typed(caught.value.hint)
        == f"the journal is damaged: `recover --discard` sets {path} aside, then check the node with `pdo`"
    )


def test_what_is_recovered_is_forgotten_and_so_is_what_undo_knew_of_it(keep: Keep, tmp_path: Path) -> None:
    one = keep()
    make(one, 0x2000)
    make(one, 0x2001)
    history = ChangeHistory(tmp_path / "changes", "can0")
    assert len(history.entries(5, IDENTITY)) == 2
    one.delete_journal(journal(one))
    assert history.entries(5, IDENTITY) == []
    assert (one.unfinished_journal(), one.lock.noted(), markers(one)) == (None, None, 0)
    make(one, 0x2002)
    assert indices(one) == [0x2002], "what was rolled back is no part of what comes after it"


def test_a_journal_that_was_kept_elsewhere_is_forgotten_there(keep: Keep) -> None:
    one = keep()
    make(one, 0x2000)
    one.lock.release()
    second = keep(name="elsewhere")
    found = second.interrupted_journal()
    assert found is not None
    second.take_lock()
    second.delete_journal(found)
    assert (one.unfinished_journal(), second.unfinished_journal(), markers(one)) == (None, None, 0)


def test_what_is_set_aside_blocks_nothing_and_is_kept(keep: Keep) -> None:
    one = keep()
    make(one, 0x2000)
    aside = one.set_aside(one.journals.path(5), "discarded")
    assert journal_document(aside)["node"] == 5
    assert (one.unfinished_journal(), one.lock.noted(), one.lock.held) == (None, None, True)


def test_the_lock_is_kept_only_where_there_is_a_journal(keep: Keep) -> None:
    one = keep()
    assert (one.lock_and_find_journal(), one.lock.held) == (None, False)
    one.take_lock()
    assert (one.lock_and_find_journal(), one.lock.held) == (None, True), "whoever held it before holds it still"
    make(one, 0x2000)
    let_go(one)
    assert not one.lock.held
    assert (one.lock_and_find_journal(), one.lock.held) == (one.journals.path(5), True)


def test_a_change_alone_is_over_with_its_end(keep: Keep) -> None:
    one = keep(group=ChangeGroup())
    make(one, 0x2000)
    assert (one.unfinished_journal(), one.lock.noted(), markers(one)) == (None, None, 0)
    one.begin(plan(5, 0x2001), IDENTITY, 5, dict)
    assert indices(one) == [0x2001]
    one.own_journal.end()
    one.own_journal.complete_group()
    assert one.unfinished_journal() is None


def test_a_folder_that_takes_nothing_is_the_users_to_mend(keep: Keep, tmp_path: Path) -> None:
    one = keep()
    (tmp_path / "state").write_text("in the way", "utf-8")
    with pytest.raises(SafetyRefusal) as caught:
        one.begin(plan(5, 0x2000), IDENTITY, 5, dict)
    state = tmp_path / "state"
    assert caught.value.text == f"{state} is not used: it is a file, not a folder"
    assert (caught.value.place, typed(caught.value.hint)) == (str(state), f"mv {state} {state}.old")
    (tmp_path / "state").unlink()
    make(one, 0x2001)
    assert indices(one) == [0x2001], "what was never begun is not rolled back"


def test_a_journal_that_cannot_be_removed_is_said_with_what_holds(keep: Keep, tmp_path: Path) -> None:
    one = keep()
    make(one, 0x2000)
    path = one.journals.path(5)
    path.unlink()
    path.mkdir()
    with pytest.raises(JournalKept) as caught:
        one.own_journal.end_group()
    assert (caught.value.place, caught.value.state) == (str(path), "left_changed")
    assert caught.value.why in ("Is a directory", "Operation not permitted")
    assert "written and verified" in (caught.value.state_text or "")
    path.rmdir()


def test_a_journal_of_ours_stays_where_another_one_was_recovered(keep: Keep) -> None:
    one = keep()
    make(one, 0x2000)
    old = journal(one)
    let_go(one)
    second = keep(name="elsewhere", group=ChangeGroup())
    second.take_lock()
    own = second.journals.write(plan(5, 0x2007), IDENTITY, 5)
    second.delete_journal(old)
    assert (one.journals.path(5).exists(), own.exists()) == (False, True)
    assert second.unfinished_journal() == own
    own.write_text("{", "utf-8")
    second.delete_journal(old)
    assert own.exists(), "whatever it is, it was not recovered"


ENDS = GroupMember(final="set-up.dvt: store on node 5", stores=(Storing(5, "all", identity=IDENTITY),))


def prepared(guard: ChangeGuard, *indices: int) -> None:
    """Prepare the journal of changes of these objects, before the first of them."""
    changes = tuple(change for index in indices for change in plan(guard.node_id, index).changes)
    guard.prepare(Plan(guard.node_id, changes), IDENTITY, 5, dict, {}, ENDS)


def part(guard: ChangeGuard, index: int) -> None:
    """Carry one part of them out, which is not remembered by itself."""
    guard.begin(plan(guard.node_id, index), IDENTITY, 5, dict, is_remembered=False)
    assert index in indices(guard)
    guard.own_journal.carried_out()
    guard.own_journal.end()


def test_the_parts_of_a_change_have_one_journal_that_is_there_before_the_first(keep: Keep) -> None:
    one = keep()
    prepared(one, 0x2000, 0x2001)
    written = one.own_journal.path.read_bytes()
    assert indices(one) == [0x2000, 0x2001]
    for index in (0x2000, 0x2001, 0x2000):  # and a way back
        part(one, index)
    assert one.own_journal.path.read_bytes() == written
    assert journal(one).member.entries == (one.own_journal.entry,), "one undo takes all parts back"
    part(one, 0x2002)  # what was not planned is put on disk before it is written
    make(one, 0x2003)
    assert indices(one) == [0x2000, 0x2001, 0x2002, 0x2003]
    assert len(set(journal(one).member.entries)) == 3, "it is a change of its own"
    one.own_journal.complete_group()
    assert not one.own_journal.path.exists()


@pytest.mark.parametrize("begun", [0, 1])
def test_what_was_prepared_and_is_put_back_or_not_begun_has_no_journal(keep: Keep, begun: int) -> None:
    one = keep()
    prepared(one, 0x2000, 0x2001)
    for _ in range(begun):
        part(one, 0x2000)
    one.own_journal.end_group()
    assert (one.unfinished_journal(), markers(one), one.lock.noted()) == (None, 0, None)
    make(one, 0x2001)
    assert indices(one) == [0x2001]


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size")
def test_all_that_a_prepared_journal_says_later_needs_no_more_space(keep: Keep) -> None:
    """Not even a new name: nothing may be made in its folder, and no file may grow."""
    one = keep()
    prepared(one, 0x2000, 0x2001)
    inode, size = one.own_journal.path.stat().st_ino, one.own_journal.path.stat().st_size
    with files_end_at(size):
        part(one, 0x2000)
        part(one, 0x2001)
        for done in (False, True):
            one.own_journal.record_stores(ENDS.final, tuple(store._replace(is_done=done) for store in ENDS.stores))
            assert [store.is_done for store in journal(one).member.stores] == [done]
        one.own_journal.note(plan(5, 0x2002))
    assert (one.own_journal.path.stat().st_ino, one.own_journal.path.stat().st_size) == (inode, size)
    assert indices(one) == [0x2000, 0x2001, 0x2002]


def test_a_journal_that_is_torn_while_it_is_written_says_what_it_said_before(keep: Keep) -> None:
    """Wherever a write of one of its later forms ends: the other form is whole."""
    one = keep()
    prepared(one, 0x2000)
    said = [one.own_journal.path.read_bytes()]
    for name in ("first", "second"):
        one.own_journal.record_stores(name)
        said.append(one.own_journal.path.read_bytes())
    for before, after, final in ((said[0], said[1], ""), (said[1], said[2], "first")):
        differing = [number for number, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]]
        for end in (*differing[:: max(1, len(differing) // 20)], differing[-1]):
            one.own_journal.path.write_bytes(after[:end] + before[end:])
            assert journal(one).member.final == final
