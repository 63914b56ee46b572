"""The error that stands behind a line: no word of it is broken by the end of a row."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.prompt.full_line import broken_by_blanks
from tests.cli.prompt.conftest import Open
from tests.cli.prompt.terminal import ENTER

WORDS = st.lists(st.text("abc", min_size=1, max_size=12), min_size=1, max_size=30)


@given(WORDS, st.integers(0, 19))
def test_rows_have_whole_words(words: list[str], used: int) -> None:
    text = broken_by_blanks(" ".join(words), used, 20)
    rows = re.findall(r"(?s).{1,20}", " " * used + text)
    assert " ".join(" ".join(rows).split()) == " ".join(words)


@pytest.mark.parametrize("columns", [60, 66, 72])
def test_a_message_breaks_between_words(open_terminal: Open, columns: int) -> None:
    terminal = open_terminal("--sim", "gen4", columns=columns, rows=40)
    terminal.wait_prompt()
    terminal.type(f"set tpdo1 --tmer 100{ENTER}")
    terminal.until(lambda: "tmer" in terminal.text and "runs" in terminal.text, "the message")
    at = next(number for number, line in enumerate(terminal.lines) if "set tpdo1" in line)
    said = " ".join(" ".join(terminal.lines[at : at + 4]).split())
    words = (
        "set tpdo1 --timer 100 No such option:? '?--tmer'?[.:]* corrected, Enter runs the line"  # by click's release
    )
    assert re.search(words, said), said
