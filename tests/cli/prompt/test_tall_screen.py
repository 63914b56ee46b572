"""On a tall screen the foot is far from the line: what is wrong stands where one looks."""

from __future__ import annotations

from tests.cli.prompt.conftest import Open, open_terminal
from tests.cli.prompt.terminal import ENTER

__all__ = ["open_terminal"]


def test_what_is_wrong_stands_behind_the_line_until_it_is_mended(open_terminal: Open) -> None:
    terminal = open_terminal("--sim", "gen4", columns=120, rows=60)
    terminal.wait_prompt()
    terminal.type("mpa tpdo1 6041")
    terminal.until(lambda: "mpa tpdo1" in terminal.cursor_line, "the line")
    terminal.type(ENTER)
    terminal.until(lambda: "unknown command 'mpa': corrected" in terminal.cursor_line, "what is wrong, after the line")
    assert terminal.text.count("unknown command") == 1, "the toolbar does not say it again"
    terminal.type("x")
    terminal.until(lambda: terminal.cursor_line.endswith("map tpdo1 6041x"), "the line alone")
