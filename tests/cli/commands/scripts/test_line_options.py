"""Options that stand behind one line count for that line, whole, and for no other."""

from __future__ import annotations

from pathlib import Path

from tests.cli.commands.bench import Bench

MAP = "map tpdo1 606C --sync 1"


def mapped(bench: Bench) -> list[str]:
    (pdo,) = bench.run("pdo tpdo1 --json").document["pdos"]
    return [entry["object"] for entry in pdo["mapping"]]


def test_an_error_is_shown_the_way_its_line_asks_for() -> None:
    with Bench() as bench:
        asked = bench.run("read 5FFF --json")
        assert asked.document["abort"] == "0x06020000"
        assert asked.stderr == ""
        plain = bench.run("read 5FFF")
        assert plain.stdout == ""
        assert plain.stderr.startswith("error: ")


def test_a_dry_run_of_a_script_at_the_prompt_writes_nothing(tmp_path: Path) -> None:
    script = tmp_path / "one.dvt"
    script.write_text(f"{MAP}\nverify tpdo1\n")
    with Bench() as bench:
        before = mapped(bench)
        assert bench.run(f"run {script} --dry-run").code == 0
        assert mapped(bench) == before
        assert bench.run(f"run {script}").code == 0
        assert mapped(bench) == ["606C:00"]


def test_a_dry_run_of_a_script_in_a_script_writes_nothing(tmp_path: Path) -> None:
    inner = tmp_path / "inner.dvt"
    inner.write_text(f"{MAP}\n")
    with Bench() as bench:
        before = mapped(bench)
        assert bench.script(f"run {inner} --dry-run", "pdo tpdo1").code == 0
        assert mapped(bench) == before


def test_yes_behind_run_answers_for_its_lines(tmp_path: Path) -> None:
    script = tmp_path / "restore.dvt"
    script.write_text("restore\n")
    with Bench() as bench:
        assert bench.run(f"run {script}").code == 6
        assert bench.run(f"run {script} --yes").code == 0
        assert bench.run("restore").code == 6


def test_the_prompt_may_ask_again_after_a_script(tmp_path: Path) -> None:
    script = tmp_path / "one.dvt"
    script.write_text("pdo\n")
    with Bench() as bench:
        assert bench.run(f"run {script}").code == 0
        assert not bench.session.in_script


def test_a_dry_run_line_leaves_the_next_line_real() -> None:
    with Bench() as bench:
        before = mapped(bench)
        dry = bench.run(f"{MAP} --dry-run --json").document
        assert dry["dry_run"] is True
        assert mapped(bench) == before
        real = bench.run(f"{MAP} --json").document
        assert real["dry_run"] is False
        assert {**real, "dry_run": True} == dry
        assert mapped(bench) == ["606C:00"]


def test_force_counts_for_its_line() -> None:
    with Bench(("generic",)) as bench:
        wrong = "map tpdo1 6041/8"
        assert bench.run(wrong).code == 1
        forced = bench.run(f"{wrong} --force")
        assert forced.code == 0
        assert "forced: " in forced.stderr
        assert bench.run("map tpdo2 6041/8").code == 1


def test_a_script_that_runs_itself_is_an_error_not_a_bug(tmp_path: Path) -> None:
    script = tmp_path / "self.dvt"
    script.write_text(f"run {script}\n")
    with Bench() as bench:
        ran = bench.run(f"run {script}")
        assert ran.code == 2
        assert "runs itself" in ran.stderr
        assert len(ran.stderr.splitlines()) < 10
