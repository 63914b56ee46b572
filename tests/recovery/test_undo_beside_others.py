"""What `undo` plans is planned under the node's lock, on what the node holds then: others may write meanwhile."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy


def elsewhere(wire: Wire, *lines: str) -> None:
    """Run *lines* in another dvtcli, which ends then."""
    with Bench((), {**wire.options, "yes": True}) as bench:
        for line in lines:
            ran = bench.run(line)
            assert ran.code == 0, ran.stderr


def cob_id(wire: Wire, word: str) -> CobId:
    with Bench((), wire.options) as bench:
        return read_pdo(bench.session.node().sdo, Pdo.parse(word)).communication.cob_id


@heavy
def test_a_recorded_undo_leaves_alone_what_another_one_changed_since_it_was_looked_at() -> None:
    with Wire(device("generic")) as wire:
        before = cob_id(wire, "tpdo2")
        with Bench((), {**wire.options, "yes": True}) as bench:
            assert bench.run("pdo").code == 0
            elsewhere(wire, "set tpdo1 --cob-id 0x1A1", "set tpdo2 --cob-id 0x2A1")
            ran = bench.run("undo --json")
            assert (ran.code, ran.document["pdo"]) == (0, "tpdo2"), ran.stdout
        assert cob_id(wire, "tpdo1").can_id == 0x1A1
        assert cob_id(wire, "tpdo2") == before


@heavy
@pytest.mark.parametrize(
    ("first", "between", "last", "label"),
    [
        ("set tpdo1 --timer 5", "set tpdo1 --timer 6", "set tpdo1 --timer 7", "TPDO1"),
        ("write 1017 800 --force", "write 1017 600 --force", "write 1017 700 --force", "1017:00"),
    ],
)
def test_undo_all_takes_nothing_back_that_another_one_changed_in_between(
    first: str, between: str, last: str, label: str
) -> None:
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        before = held(wire)
        assert bench.run(first).code == 0
        bench.session.end_line(0)
        elsewhere(wire, between)
        theirs = held(wire)
        assert bench.run(last).code == 0
        ran = bench.run("undo --all --json")
        assert (ran.code, ran.document["state"]) == (6, "unchanged")
        assert label in ran.document["text"]
        assert "another dvtcli (process " in ran.document["hint"]
        assert bench.run("undo").code == 0
        assert held(wire) == theirs
        assert bench.run("undo").code == 6
        assert bench.run("undo --force").code == 0
        assert held(wire) == before


def test_undo_all_goes_back_behind_a_reset(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        before = held(wire)
        assert bench.run("set tpdo1 --timer 5").code == 0
        assert bench.run("nmt reset-node").code == 0
        assert bench.run("set tpdo1 --inhibit 7").code == 0
        assert bench.run("undo --all").code == 0
        assert held(wire) == before


def held(wire: Wire) -> list[bytes]:
    with Bench((), wire.options) as bench:
        return [bench.session.node().sdo.upload(*place) for place in [(0x1800, 3), (0x1800, 5), (0x1017, 0)]]


def test_a_backup_is_put_back_only_by_who_holds_the_lock_and_is_said_before_anything_is_planned() -> None:
    with Wire(device("generic")) as wire:
        elsewhere(wire, "set tpdo1 --timer 5")
        with Bench((), {**wire.options, "yes": True}) as holder, Bench((), {**wire.options, "yes": True}) as bench:
            holder.session.node().begin_change()
            bench.session.node()
            wire.frames()
            ran = bench.run("undo --backup --json")
            assert ran.code == 6
            assert "another dvtcli" in ran.document["text"]
            asked = {int.from_bytes(one.data[1:3], "little") for one in wire.frames() if one.arbitration_id == 0x601}
            assert not asked & {0x1800, 0x1A00}, "nothing is planned on what somebody else is changing"


def test_a_backup_of_a_node_of_which_no_change_is_left_is_put_back_by_its_node_id(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire:
        options = {**wire.options, "yes": True, "journal": str(tmp_path)}
        with Bench((), options) as bench:
            assert bench.run("set tpdo1 --timer 5").code == 0
        for line in ("undo", "undo --backup --json"):
            with Bench((), {**options, "node": None}) as bench:
                ran = bench.run(line)
        assert (ran.code, "the history has no change on this bus" in ran.document["text"]) == (2, True)
        assert "-n ID undo --backup" in ran.document["hint"]


def test_a_backup_of_no_pdo_is_a_usage_error(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire:
        options = {**wire.options, "yes": True, "journal": str(tmp_path)}
        with Bench((), options) as bench:
            assert bench.run("set tpdo1 --timer 5").code == 0
            (backup,) = (tmp_path / "backups").glob("*.dvt")
            kept = [line for line in backup.read_text("utf-8").splitlines() if line.startswith(("#", "require"))]
            backup.write_text("\n".join(kept) + "\n", "utf-8")
            ran = bench.run("undo --backup --json")
        assert ran.code == 2
        assert "has no PDO of node 1" in ran.document["text"]


def test_a_change_that_could_not_be_remembered_is_not_confused_with_the_one_before(tmp_path: Path) -> None:
    aside = tmp_path / "aside"
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("set tpdo1 --timer 5").code == 0
        node = bench.session.node()
        assert node.guard is not None
        file = node.guard.history.path(1, node.identity())
        remembered = file.read_text("utf-8")
        file.parent.rename(aside)
        file.parent.touch()  # no folder: nothing can be remembered in it
        bench.run("set tpdo2 --timer 6")
        file.parent.unlink()
        aside.rename(file.parent)
        ran = bench.run("undo --json")
        assert (ran.code, ran.document["pdo"]) == (0, "tpdo2"), ran.stdout
        assert file.read_text("utf-8") == remembered, "the first change was not undone"
