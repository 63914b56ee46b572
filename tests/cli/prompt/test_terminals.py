"""The prompt in terminals of all kinds: narrow, tiny, without a cursor that moves, with stdout elsewhere."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, ENTER
from tests.harness.sample import heavy


def test_a_narrow_terminal_shows_what_matters_most_whole(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", columns=48)
    terminal.wait_prompt()
    terminal.until(lambda: "PRE-OP" in terminal.toolbar, "the state")
    terminal.run("map tpdo1 6C01:1 606C 6041")
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    terminal.until(lambda: terminal.toolbar.endswith("TPDO1 not stored"), "what is not stored")
    assert "F1" not in terminal.toolbar
    terminal.resize(100, 24)
    terminal.until(lambda: terminal.toolbar.endswith("TPDO1 not stored │ F1 help"), "all of it on the wider screen")


@pytest.mark.parametrize(("columns", "rows"), [(20, 5), (30, 4), (80, 3)])
def test_a_tiny_terminal_can_be_typed_at(open_terminal: Open, columns: int, rows: int) -> None:
    terminal = open_terminal("--sim", "gen4", columns=columns, rows=rows)
    terminal.wait_prompt()
    terminal.type("read 6041")
    terminal.until(lambda: "sim/1 PRE-OP> read 6041".endswith(terminal.cursor_line[-3:]), "the line")
    assert "too small" not in terminal.text
    terminal.type(f" > out{ENTER}")
    terminal.until(lambda: terminal.cursor_line[-3:] in ("OP>", "P>", ">", "-OP>"), "the prompt again")
    terminal.type("mpa" + ENTER)
    terminal.until(lambda: "shows it" in terminal.text, "the hint of the wrong line")
    assert "too small" not in terminal.text
    terminal.type(CTRL_C)
    terminal.until(lambda: terminal.cursor_line[-3:] in ("OP>", "P>", ">", "-OP>"), "the prompt again")
    terminal.type(CTRL_D)
    assert terminal.ended() == 0


def test_a_dumb_terminal_gets_a_plain_prompt(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", environment={"TERM": "dumb"})
    terminal.wait_prompt()
    terminal.run("read 6041")
    terminal.wait("Statusword")
    terminal.wait_prompt()
    terminal.type("pdo")
    terminal.until(lambda: terminal.cursor_line.endswith("pdo"), "the line")
    terminal.type(CTRL_C)
    terminal.wait_prompt()
    assert "MAPPED OBJECTS" not in terminal.text
    terminal.run("map tpdo1 \\")
    terminal.until(lambda: terminal.cursor_line == "  ...", "the second line")
    terminal.run("606C")
    terminal.wait("TPDO1 set: ")
    terminal.wait_prompt("sim/1 PRE-OP*> ")
    terminal.type(CTRL_D)
    terminal.wait("leave? [y/N]")
    terminal.type("y\r")
    assert terminal.ended() == 0
    assert b"\x1b" not in terminal.written


@pytest.mark.long
def test_a_terminal_that_does_not_say_where_its_cursor_is_can_be_typed_at(open_terminal: Open) -> None:
    """Or that says it late, as over a slow line: prompt_toolkit itself warns of that after two seconds."""
    terminal = open_terminal("--sim", "gen4")
    terminal.screen.answers = False
    terminal.wait_prompt()
    asked_s = time.monotonic()
    terminal.until(lambda: time.monotonic() > asked_s + 2.5, "more than prompt_toolkit's patience")
    assert "WARNING" not in terminal.text
    terminal.run("read 1018:1")
    terminal.wait("0x0000001E")
    terminal.wait_prompt()
    terminal.type(CTRL_D)
    assert terminal.ended() == 0


@heavy
def test_results_go_into_a_pipe_while_the_prompt_stays(open_terminal: Open, tmp_path: Path) -> None:
    shell = ["/bin/sh", "-c", f"{sys.executable} -m dvtcli --sim gen4 > out"]
    terminal = open_terminal(command=shell)
    terminal.wait_prompt()
    terminal.run("pdo")
    terminal.until(lambda: terminal.text.count("PRE-OP>") == 2, "the prompt again")
    terminal.type(CTRL_D)
    assert terminal.ended() == 0
    assert "MAPPED OBJECTS" in (tmp_path / "out").read_text()
    assert "PRE-OP" not in (tmp_path / "out").read_text()
