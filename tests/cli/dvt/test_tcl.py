"""Tcl scripts on simulated nodes: what they may do, what they are refused, and what stops them."""

from __future__ import annotations

import gc
import importlib.util
import io
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from dvtcli.cli.dvt.tcl_run import LIMITS, run_tcl
from tests.cli.commands.bench import Bench, Ran
from tests.posix import STOPPING
from tests.process import PATIENCE_S, SCRIPTS, documents, dvtcli, environment, run

pytestmark = [
    pytest.mark.skipif(
        importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here (Debian: python3-tk)"
    ),
    pytest.mark.drawn(7, "tcl"),
]


def tcl(bench: Bench, folder: Path, text: str, options: str = "") -> Ran:
    """Run *text* as the script `x.tcl` of *folder*."""
    (folder / "x.tcl").write_text(text, encoding="utf-8")
    return bench.run(f"run {folder}/x.tcl {options}")


def test_both_pdo_configs_leave_the_same_device() -> None:
    with Bench() as one, Bench() as other:
        assert one.run(f"run {SCRIPTS}/pdo_config.dvt").code == 0
        ran = other.run(f"run {SCRIPTS}/pdo_config.tcl")
        assert ran.code == 0, ran.stderr
        assert ran.stdout.splitlines()[0] == "TPDO1: 3 objects on COB-ID 0x181"
        assert other.run("pdo --all --json").document == one.run("pdo --all --json").document
        assert other.run("verify").code == 0
        assert other.run("undo --all").code == 0
        with Bench() as fresh:
            assert other.run("pdo --all --json").document == fresh.run("pdo --all --json").document


def test_a_dry_run_leaves_the_node_and_another_makers_device_is_left_alone() -> None:
    with Bench() as bench:
        before = bench.run("pdo --all --json").document
        assert bench.run(f"run {SCRIPTS}/pdo_config.tcl --dry-run").code == 0
        assert bench.run("pdo --all --json").document == before
    with Bench(("tmcm",)) as bench:
        ran = bench.run(f"run {SCRIPTS}/pdo_config.tcl")
        assert ran.code == 6
        assert "another maker's device" in ran.stderr
        assert not bench.session.node().history


def test_answers_are_values_that_a_script_looks_at(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(
            bench, tmp_path,
            'puts [sdo_rnx 1 0x1018 1]\nif {[sdo_rnx 1 0x5FFF 0] eq "Abort 0x06020000"} {puts handled}\n'
            "puts -nonewline {no }\nputs end\nputs stderr aside\nexit 0\n",
        )  # fmt: skip
        assert (ran.code, ran.stdout) == (0, "0x0000001E\nhandled\nno end\n")
        assert "aside" in ran.stderr
        assert f"{tmp_path}/x.tcl:2: sdo_rnx answered Abort 0x06020000" in ran.stderr


def test_lg_and_store_are_words_too(tmp_path: Path) -> None:
    (tmp_path / "x.tcl").write_text(
        "puts [lg 1 4]\nputs [sdo_wnx 1 0x1800 2 0x01]\nputs [store 1]\nputs [lg 1 0]\nputs [store 1]\nexit 0\n"
    )
    words = ("--sim", "gen4-locked", "run", str(tmp_path / "x.tcl"))
    done = run(words, env=environment() | {"DVTCLI_PASSCODE": "0x4444"})
    assert (done.returncode, done.stdout) == (0, "OK\nOK\nOK\nOK\nAbort 0x08000000\n"), done.stderr
    assert "4444" not in done.stderr


def test_a_failure_that_nobody_meant_is_the_exit_code(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "sdo_rnx 1 0x1018 1\nsdo_rnx 1 0x5FFF 0\nputs on\n")
        assert (ran.code, ran.stdout) == (1, "on\n")
        assert "x.tcl:2" in ran.stderr
        assert "exit 0" in ran.stderr
        error = tcl(bench, tmp_path, "sdo_wnx 1 0x1800 5 0x0700\nsdo_rnx 1 0x5FFF 0\nputs on\n", "--json").documents[-1]
        assert (error["schema"], error["exit_code"], error["state"]) == ("dvtcli.error/1", 1, "unknown")
        assert (f"at {tmp_path}/x.tcl:2 " in error["text"], "exit 0" in error["hint"]) == (True, True)
        assert tcl(bench, tmp_path, "sdo_rnx 9 0x1018 1", "--timeout 0.05").code == 5
        assert tcl(bench, tmp_path, "sdo_rnx 1 0x5FFF 0\nexit 0").code == 0
        assert tcl(bench, tmp_path, "catch {exit 3}\nputs never").code == 3


def test_with_json_every_word_is_a_document_and_puts_goes_aside(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "puts text\nsdo_rn 1 0x1018 1\ndvtcli read 1018:1\n", "--json")
        assert ran.code == 0
        assert [document["schema"] for document in ran.documents] == ["dvtcli.dvt/1", "dvtcli.value/1"]
        assert "text" in ran.stderr


def test_an_error_of_the_script_names_its_line_only_and_the_tcl_form_of_a_command(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "sdo_rnx 1 0x1018 1\nputs hi\nmap tpdo1 6041\n", "--json")
        document = ran.documents[-1]
        assert (document["at"], document["exit_code"]) == (None, 2)
        assert document["file"] == f"{tmp_path}/x.tcl:3"
        assert document["hint"].startswith("in Tcl it is `dvtcli map …`; ")
        ran = tcl(bench, tmp_path, "sdo_rnx 1 0x1018 1\nputs hi\nnosuch\n")
        assert ran.stderr.startswith(f"error: {tmp_path}/x.tcl:3: invalid command name")
        (tmp_path / "x.dvt").write_text("puts hi\n")
        assert "Tcl script is a file whose name ends in .tcl" in bench.run(f"run {tmp_path}/x.dvt").stderr


def test_an_unclosed_brace_is_found_before_anything_runs(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "sdo_wnx 1 0x1017 0 0x0064\nwhile {1} {\n  puts x\n")
        assert (ran.code, ran.stdout) == (2, "")
        assert "x.tcl:2: " in ran.stderr
        assert not bench.session.is_open


def test_an_unclosed_brace_is_found_in_a_long_script_too(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "proc f {} {\n}\nwhile {1} {\n" + "  puts x\n" * 300_000)
        assert (ran.code, ran.stdout) == (2, "")
        assert "x.tcl:3: a brace, bracket or quote opened here is not closed" in ran.stderr


def test_files_of_its_own_folder_are_read(tmp_path: Path) -> None:
    (tmp_path / "part.tcl").write_text("proc hello {} {\n  return hi\n}\n")
    (tmp_path / "wrong.tcl").write_text("\n\nbogus\n")
    (tmp_path / "data.txt").write_text("42\n")
    with Bench() as bench:
        ran = tcl(
            bench, tmp_path,
            "source [file join [file dirname [info script]] part.tcl]\nputs [hello]\n"
            "set f [open data.txt r]\nputs [read -nonewline $f]\nclose $f\nputs [file exists data.txt]\n",
        )  # fmt: skip
        assert (ran.code, ran.stdout) == (0, "hi\n42\n1\n"), ran.stderr
        ran = tcl(bench, tmp_path, "source wrong.tcl")
        assert ran.code == 2
        assert "wrong.tcl:3: " in ran.stderr


def test_a_command_of_ours_works_and_its_failure_ends_the_script(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "dvtcli require identity vendor=0x1E\ncatch {dvtcli read 5FFF}\nputs never")
        assert ran.code == 1
        assert "never" not in ran.stdout
        assert "x.tcl:2: error: " in ran.stderr


def test_what_no_answer_can_say_ends_the_script_with_its_own_code(tmp_path: Path) -> None:
    with Bench() as bench:
        assert bench.run("nmt start").code == 0
        ran = tcl(bench, tmp_path, "catch {sdo_wnx 1 0x1800 1 0x80000181}\nputs never")
        assert ran.code == 6
        assert "--yes" in ran.stderr
        assert ran.stdout == ""


def test_commands_are_counted(tmp_path: Path) -> None:
    text = b"set i 0\nwhile {$i < 9999} {incr i}\nputs never\n"
    (tmp_path / "x.tcl").write_bytes(text)
    with Bench() as bench:
        few = LIMITS._replace(steps=1000)
        code = run_tcl(bench.session, text, f"{tmp_path}/x.tcl", keep_going=False, most_seconds=None, limits=few)
        assert code == 4
        stderr = bench.session.output.stderr
        assert isinstance(stderr, io.StringIO)
        assert "x.tcl:2: stopped after 1000 Tcl commands" in stderr.getvalue()


@pytest.mark.parametrize("loop", ["while 1 {}", "while 1 {catch {while 1 {incr i}}}", "after 100000000", "vwait x"])
def test_a_script_without_end_is_stopped(loop: str, tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, f"puts begun\n{loop}\nputs never\n", "--max-seconds 0.3")
        assert (ran.code, ran.stdout) == (4, "begun\n")
        assert "seems to run without end" in ran.stderr
        assert "x.tcl" in ran.stderr


def test_one_gate_encloses_a_tcl_script(tmp_path: Path) -> None:
    with Bench() as bench:
        assert bench.run("nmt start").code == 0
        ran = bench.run(f"run {SCRIPTS}/pdo_config.tcl --yes")
        assert ran.code == 0, ran.stderr
        assert bench.run("node --json").document["nodes"][0]["state"] == "OPERATIONAL"
        assert bench.script(f"run {SCRIPTS}/pdo_config.tcl --yes", "pdo -q").code == 0


def test_keep_going_is_refused_with_a_sentence(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "puts x", "--keep-going")
        assert ran.code == 2
        assert "--keep-going is for .dvt scripts" in ran.stderr


def test_what_was_saved_as_tcl_runs(tmp_path: Path) -> None:
    with Bench() as bench:
        for line in ("map tpdo1 606C 6041 --sync 1", "sdo_wnx 1 0x1017 0 0x01F4", "set tpdo2 --timer 70"):
            assert bench.run(line).code == 0
        wanted = bench.run("pdo --all --json").document
        assert bench.run(f"save {tmp_path}/saved.tcl").code == 0
    with Bench() as other:
        ran = other.run(f"run {tmp_path}/saved.tcl")
        assert ran.code == 0, ran.stderr
        assert other.run("pdo --all --json").document == wanted
        assert other.run("read 1017 --json").document["value"] == 500
    with Bench(("tmcm",)) as another:
        assert another.run(f"run {tmp_path}/saved.tcl").code == 6


@pytest.mark.parametrize(
    "loop",
    [
        "while 1 {}",
        "while 1 {sdo_rn 1 0x1018 1}",
        "while 1 {catch {after 1000}}",
        "dvtcli sync --period 20 --count 9999",
    ],
)
def test_ctrl_c_stops_it(loop: str, tmp_path: Path) -> None:
    script = tmp_path / "x.tcl"
    script.write_text(f"puts [sdo_rnx 1 0x1018 1]\n{loop}\n")
    process = subprocess.Popen(
        [sys.executable, "-m", "dvtcli", "--sim", "gen4", "run", str(script)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=environment(),
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "0x0000001E\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, stderr
    assert "interrupted" in stderr


@pytest.mark.parametrize("number", STOPPING[:2])
def test_a_signal_in_the_middle_of_a_change_rolls_it_back(number: signal.Signals, tmp_path: Path) -> None:
    """The change's fourth write is answered late, so that the signal comes before its end."""
    script = tmp_path / "x.tcl"
    script.write_text("catch {dvtcli map tpdo1 606C 6041 6077 --sync 1}\nputs never\n")
    process = subprocess.Popen(
        [sys.executable, "-m", "dvtcli", "--sim", "gen4", "--fault", "late@4=5", "--timeout", "30", "-v",
         "run", str(script)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", env=environment(),
    )  # fmt: skip
    assert process.stderr is not None
    while "0x1800:01 <-" not in (line := process.stderr.readline()):
        assert line, "the process ended before it wrote anything"
    process.send_signal(number)
    stdout, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + number, stderr
    assert "rolled back: everything is as before" in stderr
    assert stdout == ""


def test_no_interpreter_is_left_to_another_threads_garbage_collector(tmp_path: Path) -> None:
    """Tcl aborts the process where an interpreter is deleted by another thread than made it."""
    with Bench() as bench:
        for text in ("puts x", "exec ls", "catch {dvtcli read 5FFF}", "proc f {} {", "exit 4", "sdo_rnx 9 0x1018 1"):
            tcl(bench, tmp_path, text, "--timeout 0.01")
        collector = threading.Thread(target=gc.collect)
        collector.start()
        collector.join()
        assert tcl(bench, tmp_path, "puts alive").stdout == "alive\n"


def test_control_characters_never_reach_the_terminal(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, 'puts "a\\x1b\\[31mb"')
        assert ran.code == 0
        assert "\x1b" not in ran.stdout


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_no_tcl_script(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.tcl")
    with Bench() as bench:
        writer = threading.Thread(target=(tmp_path / "x.tcl").write_text, args=("puts x",))
        writer.start()
        ran = bench.run(f"run {tmp_path}/x.tcl")
        writer.join()
        assert ran.code == 2
        assert "is a file" in ran.stderr


def test_a_step_that_the_device_refuses_is_told_with_its_line() -> None:
    done = dvtcli("--sim", "gen4", "--fault", "refuse@3=0x06040041", "run", "scripts/pdo_config.tcl")
    assert done.returncode == 1
    assert "pdo_config.tcl:36: sdo_wnx answered Abort 0x06040041" in done.stderr
    assert done.stdout == ""


def test_in_a_process_with_json(tmp_path: Path) -> None:
    done = dvtcli("--sim", "gen4", "run", "scripts/pdo_config.tcl", "--json")
    assert done.returncode == 0, done.stderr
    found = documents(done.stdout)
    assert {document["schema"] for document in found} == {"dvtcli.dvt/1"}
    assert {document["answer"] for document in found[1:-2]} == {"OK"}
