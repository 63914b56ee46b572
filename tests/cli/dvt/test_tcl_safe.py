"""What a Tcl script is refused, with its line, and what it may do to Tcl itself."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.cli.dvt.test_tcl import tcl

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here (Debian: python3-tk)"
)


REFUSED = [
    ("exec ls", 1, "exec is not available"),
    ("set a 1\nproc f {} {\n  set b 2\n  exec rm -rf /\n}\n\nf\n", 4, "exec is not available"),
    ("\nsocket localhost 80", 2, "socket is not available"),
    ("open x.txt w", 1, "may only read"),
    ("open |ls r", 1, "no such file"),
    ("open ../y r", 1, "outside the script's folder"),
    ("open /etc/passwd r", 1, "outside the script's folder"),
    ("source ../y.tcl", 1, "outside the script's folder"),
    ("file delete x.tcl", 1, "file delete is not available"),
    ("load x.so", 1, "load is not available"),
    ("puts [glob *]", 1, "glob is not available"),
    ("cd /", 1, "cd is not available"),
    ("interp create", 1, "interp is not available"),
    ("puts file7 x", 1, "file7 cannot be written to"),
    ("gets stdin", 1, 'can not find channel named "stdin"'),
    ("chan pipe", 1, "invalid command name"),
    ("fconfigure stdout", 1, "fconfigure is not available"),
    ("encoding system", 1, "encoding is not available"),
    ("rename interp mine\nmine create x", 2, "interp is not available"),
    ("interp invokehidden {} exec ls", 1, "interp is not available"),
    ("namespace eval ::tcl {exec ls}", 1, "exec is not available"),
    ("open ..", 1, "outside the script's folder"),
    ("open .", 1, ". is not a file"),
    ("open link r", 1, "outside the script's folder"),
    ("source link", 1, "outside the script's folder"),
    ("source ~/.profile", 1, "no such file"),
    ("package require http", 1, "can't find package"),
    ("puts $env(HOME)", 1, "no such variable"),
    ("file dirname", 1, "wrong # args"),
    ("exit 1 2", 1, "an exit code is 0…125"),
    ("dvtcli", 1, "a command is missing"),
    ("dvtcli save ../x.dvt", 1, "dvtcli save is not available"),
    ("dvtcli log ../x.log", 1, "dvtcli log is not available"),
    ("dvtcli run ../x.dvt", 1, "dvtcli run is not available"),
    ("dvtcli eds add ../x.eds", 1, "dvtcli eds is not available"),
    ("dvtcli verify ../x.dcf", 1, "dvtcli verify with a file is not available"),
    ("set a 1\nbogus 2", 2, 'invalid command name "bogus"'),
    ("set a [expr {1/0}]", 1, "divide by zero"),
    ("sdo_wnx 1 0x1800", 1, "it is: sdo_wnx NODE INDEX SUB VALUE [BYTES]"),
    ("sdo_wnx 1 0x1800 1 0x201", 1, "3 digits are not possible"),
    ("proc f {} {f}\nf", 2, "too many nested evaluations"),
    ("source x.tcl", 1, "too many nested evaluations"),
    ("puts a\nproc f {} {\nputs b", 2, "is not closed"),
    ('puts a\nputs "b', 2, "is not closed"),
]


@pytest.mark.drawn(6)
@pytest.mark.parametrize(("text", "line", "says"), REFUSED)
def test_what_reaches_outside_or_is_wrong_is_refused_with_its_line(
    text: str, line: int, says: str, tmp_path: Path
) -> None:
    (tmp_path / "link").symlink_to(__file__)
    with Bench() as bench:
        ran = tcl(bench, tmp_path, text)
        assert ran.code == 2, ran.stderr
        assert ran.stderr.count("x.tcl:") == 1
        assert says in ran.stderr
        assert f"x.tcl:{line}: " in ran.stderr
        assert (tmp_path / "x.tcl").exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "open pipe r")
        assert ran.code == 2
        assert "x.tcl:1: open: pipe is not a file" in ran.stderr


@pytest.mark.parametrize(
    "text",
    [
        "proc info args {sdo_rnx 1 0x1018 1}\nsdo_rnx 1 0x1018 1",
        "rename info {}\nsdo_rnx 1 0x1018 1",
        "proc if args {error broken}\nsdo_rnx 1 0x1018 1",
        "trace add execution sdo_rnx enter {sdo_rnx 1 0x1018 1 ;#}\nproc dict args {}\nsdo_rnx 1 0x1018 1",
    ],
)
def test_a_script_that_bends_tcl_itself_harms_itself_only(text: str, tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, text)
        assert ran.code in (0, 2), ran.stderr
        assert tcl(bench, tmp_path, "puts [sdo_rnx 1 0x1018 1]").stdout == "0x0000001E\n"
