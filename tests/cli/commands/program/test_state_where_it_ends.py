"""What a command that was stopped, or whose results are lost, says of what the node holds: what is so, and no more."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench, beside
from tests.harness.sample import heavy
from tests.process import PATIENCE_S, ROOT, environment
from tests.simulator.bench import booted

UNCHANGED = "  state   unchanged: nothing was written\n"
WORDS = ("diff x.dcf", "plan x.dcf", "verify x.dcf", "compare x.dcf", "apply x.dcf --yes", "clone x.dcf --yes")


def bench_with_file() -> Bench:
    """A node, and `x.dcf`, by which its TPDO1 is another one."""
    bench = Bench((), {"sim": (), "node": 1}, beside([booted("gen4")]))
    assert bench.run("export x.dcf").code == 0
    assert bench.run("map tpdo1 606C").code == 0
    return bench


def with_full_disk(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A dvtcli in *folder* whose answers go where there is no room."""
    with Path("/dev/full").open("w") as full:
        return subprocess.run(
            [sys.executable, "-m", "dvtcli", "--sim", "gen4", *words], stdout=full, stderr=subprocess.PIPE,
            encoding="utf-8", env=environment() | {"PYTHONPATH": str(ROOT)}, cwd=folder, timeout=PATIENCE_S,
            check=False,
        )  # fmt: skip


def interrupt(bench: Bench, after: int) -> list[Frame]:
    """Ctrl-C at the frame of ours that comes behind *after* others; all that were sent go to the list."""
    sent: list[Frame] = []

    def note(frame: Frame, ours: bool) -> None:
        if ours:
            sent.append(frame)
            if len(sent) == after:
                raise KeyboardInterrupt

    bench.session.open_network().bus.tap(note)
    return sent


@pytest.mark.parametrize("line", WORDS)
@pytest.mark.parametrize("json", [False, True])
def test_who_stops_what_still_reads_is_told_that_nothing_was_written(line: str, json: bool) -> None:
    with bench_with_file() as bench:
        sent = interrupt(bench, after=3)
        ran = bench.run(line + (" --json" if json else ""))
        assert ran.code == 130, ran
        assert len(sent) == 3
        if json:
            assert (ran.document["error"], ran.document["state"]) == ("interrupted", "unchanged")
        else:
            assert ran.stderr.endswith(f"error: interrupted\n{UNCHANGED}"), ran.stderr


def test_a_line_answers_for_itself_and_not_for_those_before_it() -> None:
    with bench_with_file() as bench:
        assert bench.session.state_now() == ("unknown", None), "bench_with_file wrote, and others may follow"
        for line, state in (("read 6041", "unchanged"), ("nmt preop", "unknown"), ("verify x.dcf", "unchanged")):
            bench.run(line)
            assert bench.session.state_now() == (state, None), line
        bench.session.started = False  # the program's only line
        assert bench.run("map tpdo1 6041").code == 0
        assert bench.session.state_now() == ("unknown", "written as planned and verified before that")


def test_what_a_dry_run_writes_to_a_twin_is_written_to_nobody() -> None:
    with bench_with_file() as bench:
        assert bench.run("map tpdo1 6041 --dry-run").code == 0
        assert bench.session.state_now() == ("unchanged", None)


@heavy
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_results_that_are_lost_before_the_first_write_leave_the_node_unchanged(tmp_path: Path) -> None:
    (tmp_path / "n.yaml").write_text("nodes:\n  a: {node_id: 1, tpdo: {1: {event_timer: 50}}}\n", "utf-8")
    done = with_full_disk(tmp_path, "apply", "n.yaml", "--yes")
    assert done.returncode == 1, done.stderr
    assert "the results cannot be written" in done.stderr
    assert UNCHANGED in done.stderr


@heavy
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize(
    ("words", "made"),
    [
        ("backup x.jsonl", "x.jsonl"), ("backup x.dcf", "x.dcf"), ("export x.yaml", "x.yaml"),
        ("export x.dcf", "x.dcf"), ("export x.dbc", "x.dbc"), ("report x.html", "x.html"), ("import x.yaml", "x.yaml"),
        ("log x.asc --duration 0.1", "x.asc"), ("eds convert n.eds x.xdd", "x.xdd"), ("save x.dvt --all", "x.dvt"),
        ("plan n.yaml -o x.json", "x.json"), ("read 1008 -o x.bin", "x.bin"), ("export x.cpj", "x.cpj"),
    ],
)  # fmt: skip
def test_a_file_that_was_made_is_named_where_the_answer_is_lost(words: str, made: str, tmp_path: Path) -> None:
    (tmp_path / "n.yaml").write_text("nodes:\n  a: {node_id: 1, tpdo: {1: {event_timer: 50}}}\n", "utf-8")
    (tmp_path / "n.eds").write_bytes(family_eds("gen4").read_bytes())
    ran = with_full_disk(tmp_path, *words.split())
    assert (tmp_path / made).stat().st_size > 0, ran.stderr
    (said,) = (line for line in ran.stderr.splitlines() if line.startswith("  made    "))
    assert (ran.returncode, said.split()[-1]) == (1, made), ran.stderr
    assert "unchanged: nothing was written to a node" in ran.stderr
