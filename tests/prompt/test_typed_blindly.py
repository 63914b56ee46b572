"""What is typed while a command runs is run by nobody, and a question is answered only by who has seen it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.posix import needs_typing
from tests.prompt.conftest import Open
from tests.prompt.terminal import CTRL_C, CTRL_D, ENTER, Terminal
from tests.prompt.test_real_bus import held_up, opened, prompt
from tests.prompt.wire import Wire


@pytest.fixture
def wire() -> Iterator[Wire]:
    wire = Wire()
    yield wire
    wire.close()


@needs_typing
def test_lines_typed_while_a_command_runs_are_thrown_away_and_that_is_said(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal)
    with held_up(wire, download=1):
        terminal.run("set tpdo1 --timer 70")
        terminal.until(lambda: wire.downloads == 1, "the first write")
        terminal.type(f"map tpdo1 606C{ENTER}cle")
        terminal.until(lambda: terminal.cursor_line == "cle", "what is typed, as the terminal itself shows it")
    terminal.wait("18 characters typed meanwhile were thrown away")
    terminal.wait_prompt(prompt(wire, "PRE-OP*> "))
    assert wire.device.value(0x1A00, 0) == b"\x01"
    terminal.run("undo")
    terminal.wait_prompt(prompt(wire, "PRE-OP> "))


@needs_typing
def test_lines_that_come_with_the_first_one_were_typed_blindly_too(gen4: Terminal) -> None:
    """A terminal that marks no paste sends its lines at once; the second one was meant for when the first worked."""
    gen4.type(f"map tpdo1 9999{ENTER}nmt start{ENTER}")
    gen4.wait("10 characters typed meanwhile were thrown away")
    gen4.wait_prompt()
    gen4.type(f"map tpdo1 606C{ENTER}nm")
    gen4.wait("2 characters typed meanwhile were thrown away")
    gen4.wait_prompt("sim/1 PRE-OP*> ")


def test_what_is_pasted_in_one_piece_runs_line_by_line(gen4: Terminal) -> None:
    gen4.type("\x1b[200~read 1018:1\nread 1018:2\x1b[201~")
    gen4.until(lambda: "read 1018:2" in gen4.cursor_line, "what was pasted")
    gen4.type(ENTER)
    gen4.wait("0x0705302D")
    assert "0x0000001E" in gen4.text
    assert "thrown away" not in gen4.text


def test_ctrl_c_at_a_question_is_no_and_the_next_line_answers_nothing(gen4: Terminal) -> None:
    gen4.run("restore")
    gen4.wait("restore? [y/N]")
    gen4.type(CTRL_C)
    gen4.wait("interrupted")
    gen4.wait_prompt()
    gen4.run("y")
    gen4.wait("no command is called 'y'")
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
    terminal.wait("2 characters typed meanwhile were thrown away")
    terminal.wait("restore? [y/N]")
    terminal.type(f"n{ENTER}")
    terminal.wait("not done: the answer was no")
    terminal.wait_prompt(prompt(wire, "PRE-OP*> "))


def test_ctrl_c_at_the_last_question_stays(gen4: Terminal) -> None:
    gen4.run("map tpdo1 606C")
    gen4.wait_prompt("sim/1 PRE-OP*> ")
    gen4.type(CTRL_D)
    gen4.wait("leave? [y/N]")
    gen4.type(CTRL_C)
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
