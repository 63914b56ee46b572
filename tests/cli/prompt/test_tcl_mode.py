"""Tcl's lines in a real terminal."""

from __future__ import annotations

import importlib.util

import pytest

from tests.cli.prompt.terminal import CTRL_C, CTRL_D, Terminal

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here (Debian: python3-tk)"
)

MODE = "sim/1 PRE-OP tcl> "
MORE = "sim/1 PRE-OP tcl ...> "


def test_every_line_is_tcls_until_exit_or_ctrl_d(gen4: Terminal) -> None:
    gen4.run('tcl puts "a  > b"')
    gen4.wait_prompt()
    assert "a  > b" in gen4.lines
    gen4.run("tcl")
    gen4.wait_prompt(MODE)
    gen4.run("proc twice {a} {")
    gen4.wait_prompt(MORE)
    gen4.run("expr {2 * $a}")
    gen4.wait_prompt(MORE)
    gen4.run("}")
    gen4.wait_prompt(MODE)
    gen4.run("twice [dvtcli read 1018:1]")
    gen4.wait_prompt(MODE)
    assert "60" in gen4.lines
    gen4.run("puts {")
    gen4.wait_prompt(MORE)
    gen4.type(CTRL_C)
    gen4.wait_prompt(MODE)
    gen4.run("dvtcli set tpdo1 --timer 5")
    gen4.wait_prompt("sim/1 PRE-OP tcl*> ")
    gen4.type(CTRL_D)
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    gen4.run("tcl twice 4")
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    assert "8" in gen4.lines
    gen4.run("read 9999")
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    assert any(row.startswith("error: ") for row in gen4.lines), "and not `tcl: error: `: this line is not Tcl's"


def test_ctrl_c_stops_a_line_that_runs_without_end(gen4: Terminal) -> None:
    gen4.run("tcl")
    gen4.wait_prompt(MODE)
    gen4.run("puts begun; while 1 {}")
    gen4.until(lambda: "begun" in gen4.lines, "the line's own answer")  # what was typed says `begun`, too
    gen4.type(CTRL_C)
    gen4.wait("Tcl was restarted: its variables and procedures are lost")
    gen4.wait_prompt(MODE)
    gen4.run("exit")
    gen4.wait_prompt()
