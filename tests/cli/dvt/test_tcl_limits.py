"""What a Tcl script may take: memory, time and patience; and who answers when it is stopped. Real processes."""

from __future__ import annotations

import importlib.util
import io
import signal
import time
from pathlib import Path

import pytest

from dvtcli.cli.dvt.tcl_run import LIMITS, run_tcl
from tests.cli.commands.bench import Bench
from tests.cli.dvt.children import started
from tests.cli.dvt.test_tcl import tcl
from tests.posix import STOPPING
from tests.process import PATIENCE_S, documents, dvtcli

pytestmark = [
    pytest.mark.skipif(
        importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here (Debian: python3-tk)"
    ),
    pytest.mark.drawn(8, "tcl limits"),
]

#: Each is one C call of minutes, in which Tcl looks after nothing. (With a constant it is made when the file is read.)
ENDLESS = ["expr {3**[set n 200000000]}", "expr {[string repeat 9 2000000] + 1}"]


@pytest.mark.skipif(importlib.util.find_spec("resource") is None, reason="this system limits no process's memory")
@pytest.mark.parametrize(
    "bomb",
    [
        "set x a\nwhile 1 {append x $x}",
        "set x a\nwhile 1 {catch {append x $x}}",
        "while 1 {lappend x [string repeat a 1000000][incr i]}",
        "while 1 {set a([incr i]) [list $i $i $i]}",
    ],
)
def test_a_script_that_takes_all_memory_is_stopped(bomb: str, tmp_path: Path) -> None:
    text = f"puts [sdo_rnx 1 0x1018 1]\n{bomb}\nputs never\n"
    (tmp_path / "x.tcl").write_text(text)
    little = LIMITS._replace(memory_bytes=200 << 20, seconds=60.0)
    with Bench() as bench:
        stderr = bench.session.output.stderr = io.StringIO()
        stdout = bench.session.output.stdout = io.StringIO()
        code = run_tcl(
            bench.session, text.encode(), f"{tmp_path}/x.tcl", keep_going=False, most_seconds=None, limits=little
        )
        assert code == 4, stderr.getvalue()
        assert "it needs more than 200 MiB of memory" in stderr.getvalue()
        assert f"{tmp_path}/x.tcl:" in stderr.getvalue()
        assert stdout.getvalue() == "0x0000001E\n"
        assert tcl(bench, tmp_path, "puts alive").stdout == "alive\n"


@pytest.mark.skipif(importlib.util.find_spec("resource") is None, reason="this system limits no process's memory")
def test_with_the_limits_that_users_have(tmp_path: Path) -> None:
    (tmp_path / "x.tcl").write_text("sdo_wnx 1 0x1017 0 0x0064\nset x a\nwhile 1 {append x $x}\n")
    done = dvtcli("--sim", "gen4", "--json", "run", str(tmp_path / "x.tcl"))
    assert done.returncode == 4, done.stderr
    word, error = documents(done.stdout)
    assert word["answer"] == "OK"
    assert error.items() >= {"schema": "dvtcli.error/1", "exit_code": 4, "state": "unknown", "at": None}.items()
    assert "512 MiB" in error["text"]


@pytest.mark.parametrize("endless", ENDLESS)
def test_one_long_call_is_stopped_by_its_time(endless: str, tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, f"puts begun\n{endless}\nputs never\n", "--max-seconds 0.3")
        assert (ran.code, ran.stdout) in ((4, "begun\n"), (4, "")), ran.stderr  # on a busy machine it is over before
        assert "stopped after 0.3 s of computing" in ran.stderr
        assert f"called at {tmp_path}/x.tcl:1" in ran.stderr or not ran.stdout


def test_a_constant_that_is_computed_before_the_first_line_is_stopped_too(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "puts begun\nexpr {3**200000000}\n", "--max-seconds 0.3")
        assert (ran.code, ran.stdout) == (4, ""), ran.stderr
        assert "stopped after 0.3 s of computing" in ran.stderr
        assert not bench.session.is_open


@pytest.mark.drawn(2)
@pytest.mark.parametrize("number", STOPPING)
@pytest.mark.parametrize("endless", ENDLESS)
def test_one_long_call_is_stopped_by_a_signal(endless: str, number: signal.Signals, tmp_path: Path) -> None:
    script = tmp_path / "x.tcl"
    script.write_text(f"puts [sdo_rnx 1 0x1018 1]\ncatch {{{endless}}}\nputs never\n")
    process = started("--sim", "gen4", "run", str(script))
    assert process.stdout is not None
    assert process.stdout.readline() == "0x0000001E\n"
    process.send_signal(number)
    stdout, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + number, stderr
    assert stdout == ""
    assert "Traceback" not in stderr


def test_what_a_word_waits_for_is_not_computing(tmp_path: Path) -> None:
    with Bench(in_real_time=True) as bench:
        ran = tcl(bench, tmp_path, "puts [sdo_rnx 9 0x1018 1]\nputs on\nexit 0\n", "--timeout 2.5 --max-seconds 2")
        assert (ran.code, ran.stdout) == (0, "Timeout\non\n"), ran.stderr


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("puts [string repeat a 1000001]", "1000001 characters are too many"),
        ("while 1 {puts -nonewline [string repeat a 100000]}", "more than 1000000 characters on one line"),
        ("sdo_wnx 1 0x1018 1 [string repeat 0 2000000]", "2000008 characters are too many"),
        ("error [string repeat a 2000000]", "aaaa"),
    ],
)
def test_what_is_said_has_a_bound(text: str, says: str, tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, f"\n{text}\n")
        assert ran.code == 2, ran.stderr
        assert says in ran.stderr
        assert "x.tcl:2: " in ran.stderr
        assert len(ran.stderr) < 20_000


def test_long_texts_and_all_characters_come_as_they_are(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, 'set x [string repeat "äß€\\n" 50000]\nputs $x\nputs "\\ud800 \U0001f600"\n')
        assert ran.code == 0, ran.stderr[:1000]
        assert ran.stdout.startswith("äß€\näß€\n")
        assert ran.stdout.count("äß€\n") == 50_000
        assert "\U0001f600" in ran.stdout


@pytest.mark.drawn(2)
@pytest.mark.parametrize("number", STOPPING)
@pytest.mark.parametrize("word", ["dvtcli set tpdo1 --timer 5", "dvtcli read 1018:1"])
def test_a_script_that_computes_after_a_line_is_stopped_by_a_signal(
    word: str, number: signal.Signals, tmp_path: Path
) -> None:
    script = tmp_path / "x.tcl"
    script.write_text(f"{word}\nputs begun\nflush stdout\nwhile 1 {{}}\n")
    process = started("--sim", "gen4", "run", str(script), "--max-seconds", "20")
    assert process.stdout is not None
    assert "begun\n" in iter(process.stdout.readline, "")
    time.sleep(0.5)  # until it computes: else the signal is seen before it begins to
    process.send_signal(number)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 128 + number, stderr
    assert "Traceback" not in stderr
