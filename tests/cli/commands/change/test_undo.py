"""`undo` brings back what was, however it was changed: by commands, by raw writes, or by both in turn."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.pdo import Direction, Pdo
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device

TPDO1 = Pdo(Direction.TPDO, 1)
STEPS = [
    "map tpdo1 606C",
    "map tpdo1 6041 606C --inhibit 1 --timer 5",
    "set tpdo1 --cob-id 0x3A1",
    "disable tpdo1",
    "enable tpdo1",
    "clear tpdo1",
    "write 1800:2 10",
    "write 1800:3 5",
    "write 1800:5 7",
    "write 1800:1 0x80000190",
    "write 1800:1 0x80000181",
    "write 1A00:0 0",
    "write 1A00:1 0x60770010",
    "write 1A00:2 0x60410010",
    "write 1A00:0 1",
    "write 1A00:0 2",
    "write 1800:1 0x190",
    "write 1017 100",
]


@pytest.mark.long
@settings(max_examples=max(3, settings().max_examples // 3), deadline=None)
@given(st.lists(st.sampled_from(STEPS), min_size=1, max_size=14), st.booleans())
def test_undo_brings_everything_back(lines: list[str], at_once: bool) -> None:
    with Bench() as bench:
        node = bench.session.node()
        before = read_pdo(node.sdo, TPDO1)
        heartbeat = node.upload(0x1017, 0)
        states = []
        for line in lines:
            held = read_pdo(node.sdo, TPDO1)
            done = len(node.history)
            if bench.run(line).code == 0 and len(node.history) > done:
                states.append(held)
        if at_once:
            ran = bench.run("undo --all")
            assert ran.code == (0 if states else 2), ran.stderr
        else:
            for state in reversed(states):
                ran = bench.run("undo")
                assert ran.code == 0, ran.stderr
                assert read_pdo(node.sdo, TPDO1) == state
                left = {change.label for plan in node.history for change in plan.changes}
                assert set(node.unstored) <= left
        assert read_pdo(node.sdo, TPDO1) == before
        assert node.upload(0x1017, 0) == heartbeat


def test_what_an_undo_returned_to_its_stored_state_is_not_unstored() -> None:
    """Of several changes only those that are left are unstored, and those of which a store took another value."""
    with Bench() as bench:
        node = bench.session.node()
        for line in ("map tpdo1 606C", "map tpdo2 6041", "map tpdo3 6041", "set tpdo1 --timer 5"):
            assert bench.run(line).code == 0
        for left in (["TPDO1", "TPDO2", "TPDO3"], ["TPDO1", "TPDO2"], ["TPDO1"], []):
            assert bench.run("undo").code == 0
            assert sorted(node.unstored) == sorted(left)
        for line in ("map tpdo1 606C", "store", "map tpdo2 6041", "undo"):
            assert bench.run(line).code == 0
        assert list(node.unstored) == []
        assert bench.run("undo").code == 0
        assert list(node.unstored) == ["TPDO1"], "its stored value is another"


def test_an_undo_of_an_earlier_process_s_change_leaves_nothing_unstored() -> None:
    with Wire(device("gen4")) as wire:
        for stores, left in ((False, []), (True, ["TPDO1"])):
            with Bench((), {**wire.options, "yes": True}) as first:
                assert first.run("map tpdo1 6041 606C").code == 0
                assert not stores or first.run("store").code == 0
            with Bench((), {**wire.options, "yes": True}) as second:
                assert second.run("undo").code == 0
                assert list(second.session.node().unstored) == left


@pytest.mark.parametrize("line", ["write 2005:1 1", "write 2005:1 1 --json"])
def test_a_write_only_object_is_written_without_being_read(line: str) -> None:
    with Bench(("roboteq",)) as bench:
        assert bench.run(line).code == 0
        undone = bench.run("undo")
        assert undone.code == 2
        assert "write-only" in undone.stderr


def test_a_makers_own_way_to_save_is_nothing_to_undo() -> None:
    """RoboteQ's controllers store by a write to 0x2017, as the hint of `store` says."""
    with Bench(("roboteq",)) as bench:
        assert bench.run("write 2017 1").code == 0
        undone = bench.run("undo")
        assert undone.code == 2
        assert "nothing to undo" in undone.stderr


@pytest.mark.parametrize("again", ["undo", "undo --all"])
def test_changes_that_are_undone_were_changes(again: str) -> None:
    with Bench() as bench:
        assert "this session changed nothing on the node" in bench.run(again).stderr
        for line in ("set tpdo1 --timer 100", "store", "undo"):
            assert bench.run(line).code == 0
        undone = bench.run(again)
        undone.failed(2, "nothing to undo: every change of this session is undone")


def test_a_node_of_this_process_has_no_backup_which_does_not_say_that_nothing_was_changed() -> None:
    with Bench() as bench:
        assert bench.run("set tpdo1 --timer 100").code == 0
        undone = bench.run("undo --backup")
        assert undone.code == 2
        assert "it is simulated in this process, for which no backups are made" in undone.stderr
        assert bench.run("undo").code == 0
