"""Single lines of Tcl: at the prompt, where one knows what the one before it set, and in a command of its own."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.cli.boundary import exit_code_of
from dvtcli.cli.dvt.tcl_run import TclMode
from dvtcli.cli.dvt.words import listed
from dvtcli.errors import UsageError
from tests.cli.commands.bench import Bench

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here (Debian: python3-tk)"
)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench() as made:
        yield made


@pytest.fixture
def tcl(bench: Bench) -> Iterator[TclMode]:
    mode = TclMode(bench.session)
    yield mode
    mode.close()


def said(bench: Bench) -> str:
    """What was printed since it was last asked."""
    stream = bench.session.output.stdout
    assert isinstance(stream, io.StringIO)
    text = stream.getvalue()
    stream.seek(0)
    stream.truncate()
    return text


def test_a_line_knows_what_the_lines_before_it_set(bench: Bench, tcl: TclMode) -> None:
    for line in ("set x 20", "proc twice {a} {", "return [expr {2 * $a}]", "}", "twice $x"):
        assert tcl.typed(line) == 0
        assert tcl.continues == (line in ("proc twice {a} {", "return [expr {2 * $a}]"))
    assert said(bench) == "20\n40\n"


def test_what_dvtcli_reads_is_a_value(bench: Bench, tcl: TclMode) -> None:
    assert tcl.run("expr {[dvtcli read battery_voltage] + [dvtcli read 1000]}") == 0
    raw = int.from_bytes(bench.session.node().upload(0x5100, 1), "little")
    assert said(bench) == f"{raw + int.from_bytes(bench.session.node().upload(0x1000, 0), 'little')}\n"


def test_several_objects_are_a_list(bench: Bench, tcl: TclMode) -> None:
    assert (
        tcl.run(
            "lassign [dvtcli read 1018:1 1008 1000] vendor name; puts $vendor-$name; llength [dvtcli read 1000 1008]"
        )
        == 0
    )
    vendor, name = said(bench).splitlines()[0].split("-", 1)
    assert (vendor, name) == ("30", bench.session.node().upload(0x1008, 0).decode().rstrip("\0"))


@pytest.mark.parametrize("text", ["a b", "} exit", "[exit 3]", "$x", 'q"', "back\\", "", "#", "two\nlines", ";", "{"])
def test_no_text_of_a_device_ends_an_element(bench: Bench, tcl: TclMode, text: str) -> None:
    assert tcl.run(f"set both {{{listed([text, 5])}}}; puts [llength $both][lindex $both 0]") == 0
    assert said(bench) == f"2{text}\n"


def test_a_script_reads_values_too(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "x.tcl").write_text("if {[dvtcli read 1018:1] == 0x1E} {puts [dvtcli read 1018:1]}\n")
    assert bench.run(f"run {tmp_path}/x.tcl").stdout == "30\n"


def test_a_command_that_failed_ends_the_line_and_nothing_behind_it_is_done(bench: Bench, tcl: TclMode) -> None:
    before = bench.session.node().upload(0x1017, 0)
    assert tcl.typed("set x 5") == 0
    assert tcl.typed("catch {dvtcli read 5FFF}; sdo_wnx 1 0x1017 0 0x1234; puts never") == 1
    assert bench.session.node().upload(0x1017, 0) == before
    assert "never" not in said(bench)
    assert tcl.typed("set x") == 0
    assert said(bench) == "5\n"


def test_a_word_that_was_refused_is_the_lines_code(tcl: TclMode) -> None:
    assert tcl.typed("set answer [sdo_rnx 1 0x5FFF 0]") == 1
    assert tcl.typed("puts $answer") == 0


def test_an_error_leaves_the_variables(bench: Bench, tcl: TclMode) -> None:
    tcl.typed("set x 7")
    with pytest.raises(UsageError, match='invalid command name "nosuch"'):
        tcl.typed("nosuch")
    with pytest.raises(UsageError, match="not available"):
        tcl.typed("exec ls")
    said(bench)
    assert tcl.typed("set x") == 0
    assert said(bench) == "7\n"


def test_exit_leaves_the_mode_with_its_code(tcl: TclMode) -> None:
    tcl.on = True
    assert tcl.typed("catch {exit 4}; puts never") == 4
    assert not tcl.on


def test_tcl_begins_anew_after_it_was_stopped(bench: Bench, tcl: TclMode) -> None:
    tcl.typed("set x 7")
    assert tcl._lines is not None
    tcl._lines._process._process.kill()
    assert exit_code_of(bench.session, lambda: tcl.typed("set x")) == 1
    assert "variables and procedures are lost" in str(bench.session.output.stderr.getvalue())
    with pytest.raises(UsageError, match="no such variable"):
        tcl.typed("set x")
    assert tcl.typed("set x 8") == 0


def test_a_line_without_end_is_stopped_by_its_own_time(bench: Bench) -> None:
    from dvtcli.cli.dvt.tcl_run import LIMITS, TclLines
    from dvtcli.errors import InputFileError

    lines = TclLines(bench.session, LIMITS._replace(seconds=0.2))
    try:
        for _ in range(2):
            with pytest.raises(InputFileError, match="seems to run without end"):
                lines.line("while 1 {}")
            assert lines.waits
        assert lines.line("set x 1").code == 0
    finally:
        lines.close()


def test_a_line_may_run_so_many_commands_however_many_ran_before(bench: Bench) -> None:
    from dvtcli.cli.dvt.tcl_run import LIMITS, TclLines
    from dvtcli.errors import InputFileError

    lines = TclLines(bench.session, LIMITS._replace(steps=400))
    try:
        for _ in range(3):
            assert lines.line("for {set i 0} {$i < 100} {incr i} {set x $i}").code == 0
        with pytest.raises(InputFileError, match="400 Tcl commands"):
            lines.line("for {set i 0} {$i < 900} {incr i} {set x $i}")
    finally:
        lines.close()


def test_a_file_given_as_a_line_gets_the_command_that_runs_it(bench: Bench) -> None:
    ran = bench.run("tcl x.tcl")
    assert (ran.code, "hint    `dvtcli --sim gen4 run x.tcl` runs a file\n" in ran.stderr) == (2, True), ran.stderr
    assert "did stays" not in ran.stderr, "nothing was called before"
    ran = bench.run("tcl 'dvtcli read 6041; error odd'")
    assert (ran.code, "hint    what its earlier commands did stays" in ran.stderr) == (2, True), ran.stderr


def test_one_line_in_a_command_of_its_own(bench: Bench) -> None:
    ran = bench.run("tcl puts [expr 2*3]")
    assert (ran.code, ran.stdout) == (0, "6\n")
    ran = bench.run("tcl 'foreach {'")
    assert ran.code == 2
    assert "not closed" in ran.stderr
    ran = bench.run("tcl")
    assert ran.code == 2
    assert "the prompt" in ran.stderr


def test_a_dvt_script_takes_no_tcl_line_and_says_so_before_its_first_line(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "x.dvt").write_text("set tpdo1 --timer 5\ntcl puts 1\n")
    ran = bench.run(f"run {tmp_path}/x.dvt")
    assert ran.code == 2
    assert f"{tmp_path}/x.dvt:2: tcl is for the prompt and the shell" in ran.stderr
    assert not bench.session.is_open


@pytest.mark.parametrize(("typed", "meant"), [("6041 0", "0x6041 0x00"), ("0x1018 10", ""), ("0x1A00 0x40", "")])
def test_decimal_numbers_that_were_meant_in_hex_are_explained(bench: Bench, typed: str, meant: str) -> None:
    ran = bench.run(f"sdo_rnx 1 {typed} --json")
    assert ran.code == 1
    first = ran.document["reasons"][0]
    assert (f"did you mean {meant}?" in first) == bool(meant)


def test_pdo_config_says_what_there_is(bench: Bench) -> None:
    ran = bench.run("pdo_config 1")
    rows = ran.stdout.splitlines()
    assert rows[0] == "TPDO1 0x181 type 255: 0x6041:00/16 Statusword"
    assert rows[-1].startswith("set all: a script")
    assert bench.run("map tpdo1 6041 606C").code == 0
    assert bench.run("pdo_config").stdout.splitlines()[0].endswith("0x606C:00/32 Velocity actual value")
