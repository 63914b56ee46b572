"""What is typed while a command runs stands on the next line, and a question is answered only by who has seen it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import CTRL_C, CTRL_D, ENTER, Terminal
from tests.cli.prompt.test_real_bus import held_up, opened, prompt
from tests.cli.prompt.wire import Wire
from tests.posix import needs_typing


@pytest.fixture
def wire() -> Iterator[Wire]:
    wire = Wire()
    yield wire
    wire.close()


@needs_typing
def test_lines_typed_while_a_command_runs_stand_at_the_prompt_and_do_not_run(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal)
    with held_up(wire, download=1):
        terminal.run("set tpdo1 --timer 70")
        terminal.until(lambda: wire.downloads == 1, "the first write")
        terminal.type(f"map tpdo1 606C{ENTER}cle")
        terminal.until(lambda: terminal.cursor_line == "cle", "what is typed, as the terminal itself shows it")
    terminal.wait("the line has the input typed in between; Enter runs it")
    terminal.until(lambda: terminal.cursor_line == "  ... cle", "the second line, as a line that goes on")
    assert prompt(wire, "PRE-OP*> map tpdo1 606C") in terminal.text
    assert wire.device.value(0x1A00, 0) == b"\x01"
    terminal.type(CTRL_C)
    terminal.wait_prompt(prompt(wire, "PRE-OP*> "))
    terminal.run("undo")
    terminal.wait_prompt(prompt(wire, "PRE-OP> "))


@needs_typing
def test_a_line_typed_ahead_runs_by_the_next_enter(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal)
    with held_up(wire, download=1):
        terminal.run("set tpdo1 --timer 70")
        terminal.until(lambda: wire.downloads == 1, "the first write")
        terminal.type(f"reax\x7fd\t1018:1{ENTER}")
        terminal.until(lambda: "1018:1" in terminal.cursor_line or "1018:1" in terminal.text, "what is typed")
    terminal.until(lambda: terminal.cursor_line == prompt(wire, "PRE-OP*> read 1018:1"), "it on the line")
    terminal.type(ENTER)
    terminal.wait("0x1018:01")


def test_a_terminal_that_cannot_edit_a_line_throws_away_what_was_typed_meanwhile(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", environment={"TERM": "dumb"})
    terminal.wait_prompt()
    terminal.type("restore\n")
    terminal.wait("restore? [y/N]")
    terminal.type("n\nread 1018:1\n")
    terminal.wait("12 characters typed in between were discarded")
    terminal.wait_prompt()
    assert "0x1018:01" not in terminal.text


@needs_typing
def test_lines_that_come_with_the_first_one_were_typed_blindly_too(gen4: Terminal) -> None:
    """A terminal that marks no paste sends its lines at once; the second one was meant for when the first worked."""
    gen4.type(f"map tpdo1 9999{ENTER}nmt start{ENTER}")
    gen4.until(lambda: gen4.cursor_line == "sim/1 PRE-OP> nmt start", "the second line at the prompt")
    gen4.type(CTRL_C)
    gen4.wait_prompt()
    gen4.type(f"map tpdo1 606C{ENTER}nm")
    gen4.until(lambda: gen4.cursor_line == "sim/1 PRE-OP*> nm", "what was begun at the prompt")


def test_what_is_pasted_in_one_piece_runs_line_by_line(gen4: Terminal) -> None:
    gen4.type("\x1b[200~read 1018:1\nread 1018:2\x1b[201~")
    gen4.until(lambda: "read 1018:2" in gen4.cursor_line, "what was pasted")
    gen4.type(ENTER)
    gen4.wait("0x0705302D")
    assert "0x0000001E" in gen4.text
    assert "discarded" not in gen4.text


def test_ctrl_c_at_a_question_is_no_and_the_next_line_answers_nothing(gen4: Terminal) -> None:
    gen4.run("restore")
    gen4.wait("restore? [y/N]")
    gen4.type(CTRL_C)
    gen4.wait("interrupted")
    gen4.wait_prompt()
    gen4.run("y")
    gen4.wait("unknown command 'y'")
    gen4.type(CTRL_C)
    gen4.wait_prompt("sim/1 PRE-OP> ")


@needs_typing
def test_what_was_typed_before_a_question_answers_nothing(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal)
    terminal.type("\x1b[200~set tpdo1 --timer 70\nrestore\x1b[201~")
    terminal.until(lambda: "restore" in terminal.cursor_line, "what was pasted")
    with held_up(wire, download=1):
        terminal.type(ENTER)
        terminal.until(lambda: wire.downloads == 1, "the first write")
        terminal.type(f"y{ENTER}")
        terminal.until(lambda: "y" in terminal.lines, "what is typed, as the terminal itself shows it")
    terminal.wait("input typed before this question does not answer it; it is kept for the next line")
    terminal.wait("restore? [y/N]")
    terminal.type(f"n{ENTER}")
    terminal.wait("not done: the answer was no")
    terminal.until(lambda: terminal.cursor_line == prompt(wire, "PRE-OP*> y"), "what was typed, on the line")


def test_ctrl_c_at_the_last_question_stays(gen4: Terminal) -> None:
    gen4.run("map tpdo1 606C")
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    gen4.type(CTRL_D)
    gen4.wait("leave? [y/N]")
    gen4.type(CTRL_C)
    gen4.wait("note: dvtcli stays open; store stores the changes, undo reverts them")
    gen4.wait_prompt("sim/1 PRE-OP*> ")


def test_a_question_that_is_wider_than_the_terminal_breaks_between_words(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "tmcm", columns=60)
    terminal.wait_prompt()
    terminal.run("nmt start")
    terminal.wait_prompt("sim/1 OP> ")
    terminal.run("learn --isolated")
    terminal.wait("[y/N]")
    lines = [line.strip() for line in terminal.lines]
    asked = " ".join(lines[next(n for n, line in enumerate(lines) if "of node 1 will be written" in line) :])
    assert "the node is OPERATIONAL, will be PRE-OPERATIONAL meanwhile, and OPERATIONAL again after that" in asked
    assert "PDOs that are off are written in OPERATIONAL, too; nothing else is on the bus, as was said; learn?" in asked
    terminal.type(f"n{ENTER}")
    terminal.wait("the answer was no")
