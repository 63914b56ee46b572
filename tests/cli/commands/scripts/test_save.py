"""`save` writes what was changed as it ended; `--history` how it came to that, `--all` whatever the node holds."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy

TRIALS = [
    "map tpdo1 606C --sync 1",
    "map tpdo1 6041 606C --sync 1",
    "store",
    "write 1017 100",
    "map tpdo1 606C 6041 --sync 2",
    "write 1017 200",
]


def words(file: Path) -> list[str]:
    return [" ".join(line.split()[:2]) for line in file.read_text("utf-8").splitlines()[2:]]


def test_trial_and_error_and_the_stores_between_are_left_out(tmp_path: Path) -> None:
    saved = tmp_path / "x.dvt"
    with Bench(("generic",)) as bench:
        for line in TRIALS:
            assert bench.run(line).code == 0
        wanted = bench.run("pdo --all --json").document
        ran = bench.run(f"save {saved} --json")
        assert ran.document.items() >= {"schema": "dvtcli.save/1", "commands": 2}.items()
        assert words(saved) == ["map tpdo1", "write 1017:00"]
        assert "store" not in saved.read_text()
        assert bench.run("store").code == 0
        assert bench.run(f"save {saved} --yes").code == 0
        assert words(saved) == ["map tpdo1", "write 1017:00", "store"], "the end is stored"
    with Bench(("generic",)) as other:
        assert other.run(f"run {saved}").code == 0
        assert other.run("pdo --all --json").document == wanted
        assert other.run("read 1017 --json").document["value"] == 200


@pytest.mark.parametrize("suffix", ["dvt", "tcl"])
def test_history_has_each_step(tmp_path: Path, suffix: str) -> None:
    saved = tmp_path / f"x.{suffix}"
    with Bench(("generic",)) as bench:
        for line in TRIALS:
            assert bench.run(line).code == 0
        assert bench.run(f"save {saved} --history").code == 0
    lines = [line.removeprefix("dvtcli ") for line in saved.read_text().splitlines()[2:]]
    assert [line.split()[0] for line in lines] == [line.split()[0] for line in TRIALS]


@heavy
@pytest.mark.parametrize("suffix", ["dvt", "tcl"])
def test_all_is_everything_that_the_pdos_hold(tmp_path: Path, suffix: str) -> None:
    saved = tmp_path / f"x.{suffix}"
    with Bench(("generic",)) as bench:
        assert bench.run(f"save {saved} --all").code == 0, "also where nothing was changed"
        fresh = bench.run("pdo --all --json").document
        for line in ("map tpdo1 606C --cob-id 0x6A1", "set tpdo2 --cob-id 0x181", "clear all"):
            assert bench.run(line).code == 0
        ran = bench.run(f"run {saved}")
        assert ran.code == 0, ran.stderr
        assert bench.run("pdo --all --json").document == fresh


def test_what_ends_as_it_began_is_nothing_to_save(tmp_path: Path) -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("set tpdo1 --sync 3").code == 0
        assert bench.run("set tpdo1 --event").code == 0
        ran = bench.run(f"save {tmp_path / 'x.dvt'}")
        assert ran.code == 2
        assert "reverted" in ran.stderr
        assert bench.run(f"save {tmp_path / 'x.dvt'} --history --all").code == 2
        assert bench.run(f"save {tmp_path / 'x.dvt'} --history").code == 0


def test_can_ids_that_were_exchanged_are_given_up_first(tmp_path: Path) -> None:
    saved = tmp_path / "x.dvt"
    with Bench(("generic",)) as bench:
        for line in ("set tpdo1 --cob-id 0x6A0", "set tpdo2 --cob-id 0x181", "set tpdo1 --cob-id 0x281"):
            assert bench.run(line).code == 0
        wanted = bench.run("pdo --all --json").document
        assert bench.run(f"save {saved}").code == 0
    assert words(saved)[0] == "disable tpdo1"
    with Bench(("generic",)) as other:
        assert other.run(f"run {saved}").code == 0
        assert other.run("pdo --all --json").document == wanted


def test_commands_to_all_nodes_without_a_selected_one_are_steps_too(tmp_path: Path) -> None:
    saved = tmp_path / "x.dvt"
    with Wire(device("generic", 1)) as wire, Bench((), {**wire.options, "node": None, "yes": True}) as bench:
        assert bench.run("nmt preop all").code == 0
        assert bench.run("map 1:tpdo1 606C").code == 0
        assert bench.run(f"save {saved} --history").code == 0
        assert [line.split()[0] for line in saved.read_text().splitlines()] == ["#", "nmt", "node", "require", "map"]


def test_a_restore_ends_what_came_before_it(tmp_path: Path) -> None:
    saved = tmp_path / "x.dvt"
    with Bench(("generic",)) as bench:
        for line in ("map tpdo1 606C", "store", "restore --yes", "nmt reset-node", "set tpdo2 --timer 30"):
            assert bench.run(line).code == 0
        assert bench.run(f"save {saved}").code == 0
    assert words(saved) == ["restore", "nmt reset-node", "map tpdo2"]


STEPS = [
    "map tpdo1 606C",
    "map tpdo1 6041 606C --inhibit 1 --timer 5",
    "map tpdo2 6077 --cob-id 0x181",
    "map tpdo2 606C --cob-id auto --off",
    "set tpdo1 --cob-id 0x281",
    "set tpdo1 --cob-id 0x6A1",
    "set tpdo2 --cob-id 0x6A2 --sync 4",
    "disable tpdo1",
    "enable tpdo1",
    "enable tpdo2",
    "clear tpdo1",
    "map rpdo1 dummy/8 6040 --cob-id 0x3A1",
    "clear rpdo1",
    "write 1800:2 10",
    "write 1800:5 7",
    "write 1800:1 0x80000190",
    "write 1A00:0 0",
    "write 1A00:1 0x60770010",
    "write 1A00:0 1",
    "write 1017 100",
    "write 1017 0",
    "store",
    "undo",
]


@settings(
    max_examples=max(3, settings().max_examples // 3),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@pytest.mark.long
@example(["write 1017 100", "write 1017 100", "undo"])  # undone is the write that changed something
@given(st.lists(st.sampled_from(STEPS), min_size=1, max_size=12))
def test_the_end_state_on_a_fresh_device_gives_the_same(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str]
) -> None:
    saved = tmp_path_factory.mktemp("saved") / "x.dvt"
    with Bench(("generic",)) as bench:
        fresh = bench.run("pdo --all --json").document, bench.run("read 1017 --json").document
        for line in lines:
            bench.run(line)
        wanted = bench.run("pdo --all --json").document, bench.run("read 1017 --json").document
        code = bench.run(f"save {saved}").code
        if code:
            assert (code, wanted) == (2, fresh)
            return
    with Bench(("generic",)) as other:
        ran = other.run(f"run {saved}")
        assert ran.code == 0, (saved.read_text(), ran.stderr)
        assert (other.run("pdo --all --json").document, other.run("read 1017 --json").document) == wanted
