"""Scripts that run scripts: all are parsed before the first line, and none runs itself."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from tests.cli.commands.bench import Bench


def test_a_wrong_line_in_an_inner_script_stops_the_outer_one_before_its_first_line(tmp_path: Path) -> None:
    inner = tmp_path / "inner.dvt"
    inner.write_text("# fine\npdo\nbogus\n")
    middle = tmp_path / "middle.dvt"
    middle.write_text(f"run {inner}\n")
    with Bench() as bench:
        ran = bench.script("map tpdo1 606C", f"run {middle}")
        assert ran.code == 2
        assert f"{inner}:3: unknown command 'bogus'" in ran.stderr
        assert ran.stdout == ""
        assert not bench.session.record.lines


def test_a_missing_script_is_said_before_anything_runs(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = bench.script("map tpdo1 606C", f"run {tmp_path / 'nosuch.dvt'}")
        assert ran.code == 2
        assert "test.dvt:2: " in ran.stderr
        assert not bench.session.record.lines


def test_a_script_that_the_script_itself_saves_runs(tmp_path: Path) -> None:
    saved = tmp_path / "saved.dvt"
    with Bench() as bench:
        ran = bench.script("map tpdo1 606C", f"save {saved}", f"run {saved}")
        assert ran.code == 0, ran.stderr


def test_scripts_that_run_each_other_in_a_ring_are_refused(tmp_path: Path) -> None:
    one, two = tmp_path / "one.dvt", tmp_path / "two.dvt"
    one.write_text(f"run {two}\n")
    two.write_text(f"pdo\nrun {one}\n")
    with Bench() as bench:
        ran = bench.script("map tpdo1 606C", f"run {one}")
        assert ran.code == 2
        assert f"{two}:2: {one} runs itself" in ran.stderr
        assert not bench.session.record.lines


def test_a_chain_that_is_too_long_and_a_tree_that_is_too_wide(tmp_path: Path) -> None:
    files = [tmp_path / f"{number}.dvt" for number in range(30)]
    for file, following in pairwise(files):
        file.write_text(f"run {following}\n" * 2)
    files[-1].write_text("pdo -q\n")
    with Bench() as bench:
        ran = bench.script(f"run {files[0]}")
        assert ran.code == 2
        assert "more than 20 scripts" in ran.stderr
        assert bench.run(f"run {files[26]} -q").code == 0


def test_an_error_of_a_line_with_json_is_a_document() -> None:
    with Bench() as bench:
        ran = bench.script("map tpdo1 606C", "map tpdo1 6041 --bogus --json")
        assert ran.code == 2
        assert (ran.document["schema"], ran.document["exit_code"]) == ("dvtcli.error/1", 2)
        assert ran.document["file"] == "test.dvt:2"
        assert bench.run("bogus").stdout == ""


def test_a_failing_line_says_that_what_was_done_above_stays() -> None:
    with Bench() as bench:
        for number, wrong in enumerate(("read 5FFF", "map tpdo1 1018:1")):
            ran = bench.script(f"map tpdo1 {('606C', '6041')[number]}", wrong)
            assert ran.code == 1
            assert "unchanged by this line; the changes of test.dvt:1 stay" in ran.stderr
        assert "nothing was written" in bench.run("map tpdo1 1018:1").stderr


def test_sync_says_why_no_frame_comes_while_the_script_works_on_the_node() -> None:
    with Bench() as bench:
        assert bench.run("nmt start").code == 0
        ran = bench.script("map tpdo1 606C --sync 1 --yes", "sync")
        assert ran.code == 0
        assert "node 1 sent none: this script changes PDOs" in ran.stdout
        started = bench.script("map tpdo1 6041 --sync 1 --yes", "nmt start", "sync")
        assert "TPDO1 node 1" in started.stdout
        assert "sent none" not in started.stdout
