"""`pdo tpdo1` at the prompt of a living bus: what the last frame held, and how regularly it comes."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import Terminal
from tests.cli.prompt.test_real_bus import opened, prompt
from tests.cli.prompt.wire import Wire

TPDO2 = bytes.fromhex("24 FA FF FF 37 12 01 00")


@pytest.fixture
def wire() -> Iterator[Wire]:
    wire = Wire()
    yield wire
    wire.close()


def test_the_last_frame_is_shown_with_its_values_and_its_period(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal)
    wire.say(0x285, bytes(8))
    wire.say(0x285, TPDO2)
    last = re.compile(r"last frame  24 FA FF FF 37 12 01 00 +\d+\.\d s ago, period \d+\.\d ms \(")
    terminal.until(lambda: _shown(wire, terminal, "pdo tpdo2") and bool(last.search(terminal.text)), "both frames")
    assert terminal.row("  1  606C:00").endswith("-1500 rpm       rpm")
    assert terminal.row("  3  5100:02").endswith("0.06 A (1)      1/16 A")


def test_a_pdo_that_was_not_heard_has_no_values(wire: Wire, open_terminal: Open) -> None:
    terminal = opened(wire, open_terminal)
    wire.say(0x285, TPDO2)
    terminal.run("pdo tpdo1")
    terminal.wait("least significant byte first")
    terminal.wait_prompt(prompt(wire, "PRE-OP> "))
    assert "last frame" not in terminal.text


def test_the_cells_grow_with_the_terminal(gen4: Terminal, open_terminal: Open) -> None:
    gen4.run("pdo tpdo2")
    gen4.wait("TPDO2 of node 1")
    gen4.wait_prompt()
    (narrow,) = [line for line in gen4.lines if "┌" in line]
    assert len(narrow) == 79
    wide = open_terminal("--sim", "gen4", columns=120, rows=40)
    wide.wait_prompt()
    wide.run("pdo tpdo2")
    wide.wait("TPDO2 of node 1")
    wide.wait_prompt()
    (border,) = [line for line in wide.lines if "┌" in line]
    assert len(border) == 95
    assert "Torque actual value" in wide.text


def _shown(wire: Wire, terminal: Terminal, line: str) -> bool:
    """Run *line* anew, on an empty screen, until the prompt's thread has heard the frames."""
    terminal.type("\x0c")
    terminal.until(lambda: terminal.cursor_line == terminal.lines[0] == prompt(wire, "PRE-OP>"), "an empty screen")
    terminal.run(line)
    terminal.wait_prompt(prompt(wire, "PRE-OP> "))
    return True
