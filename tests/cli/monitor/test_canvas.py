"""A canvas draws what changed, and the terminal shows the whole picture."""

from __future__ import annotations

from collections.abc import Iterable
from io import StringIO

import pyte
import pytest
from hypothesis import given
from hypothesis import strategies as st
from prompt_toolkit.application import create_app_session
from prompt_toolkit.data_structures import Size
from prompt_toolkit.input import PipeInput, create_pipe_input
from prompt_toolkit.key_binding import KeyBindings
from prompt_toolkit.output.vt100 import Vt100_Output

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.screen.full_screen import bind_leaving, show
from dvtcli.cli.view.lines import Cell
from dvtcli.cli.view.output import Output

COLUMNS, ROWS = 12, 4
TEXT = st.text(st.sampled_from("ab c|\u2500\u2026\xe9\u6f22\u0301"), max_size=8)
CELL = st.builds(Cell, TEXT, st.sampled_from(["", "red", "reverse"]))
PICTURE = st.lists(st.lists(CELL, max_size=2), max_size=ROWS)


#: pictures after the last that are the same: by then it was drawn
_AFTER = 3


class Terminal(StringIO):
    """A terminal with its screen."""

    def __init__(self) -> None:
        super().__init__()
        self.screen = pyte.Screen(COLUMNS, ROWS)
        self._stream = pyte.Stream(self.screen)

    def write(self, text: str) -> int:
        self._stream.feed(text)
        return super().write(text)


class Shown:
    """A screen with one of *pictures* after the other, a key between them; *shown* is the last on *terminal*."""

    def __init__(self, pictures: list[list[list[Cell]]], terminal: Terminal, typed: PipeInput) -> None:
        self._pictures, self._terminal, self._typed = pictures, terminal, typed
        self._number = 0
        self.shown, self.written = list[str](), ""

    def gather(self) -> None:
        """Look at the terminal, and type the next key: each has a picture."""
        self.shown, self.written = list(self._terminal.screen.display), self._terminal.getvalue()
        self._number += 1
        self._typed.send_text("a" if self._number < len(self._pictures) + _AFTER else "q")

    def lines(self, _columns: int, _rows: int) -> Iterable[list[Cell]]:
        return self._pictures[min(self._number, len(self._pictures)) - 1]

    def leave(self) -> None:
        """The screen has ended."""


def drawn(*pictures: list[list[Cell]]) -> Shown:
    """Show *pictures*."""
    terminal, keys = Terminal(), KeyBindings()
    bind_leaving(keys)
    keys.add("a")(lambda _event: None)
    with create_pipe_input() as typed:
        screen = Shown(list(pictures), terminal, typed)
        with create_app_session(typed, Vt100_Output(terminal, lambda: Size(ROWS, COLUMNS), term="xterm")):
            show(Conversation(Output()), screen, keys, None)
    return screen


@given(st.lists(PICTURE, min_size=2, max_size=5))
def test_a_picture_looks_the_same_whatever_was_before(pictures: list[list[list[Cell]]]) -> None:
    assert drawn(*pictures).shown == drawn(pictures[-1]).shown


def test_a_row_that_stays_is_not_written_again() -> None:
    stays = [Cell("stays", "red")]
    screen = drawn([stays, [Cell("one")]], [stays, [Cell("two")]], [stays], [stays, [Cell("four")]])
    assert screen.written.count("stays") == 1
    assert [line.rstrip() for line in screen.shown] == ["stays", "four", "", ""]


@pytest.mark.parametrize(
    ("text", "shown"), [("e\u0301!", "\xe9!"), ("\x07x", "^Gx"), ("\u6f22" * 7, "\u6f22" * 6), ("ab" * 9, "ab" * 6)]
)
def test_characters_of_other_widths_and_a_line_that_is_too_long(text: str, shown: str) -> None:
    assert drawn([[Cell(text)]]).shown[0].strip() == shown


class Still:
    """A screen that is looked at *looks* times and stays as it is; then *typed* gets the key that leaves it."""

    def __init__(self, looks: int, typed: PipeInput, terminal: Terminal) -> None:
        self._left, self._typed, self._terminal = looks, typed, terminal
        self.lengths = list[int]()

    def gather(self) -> None:
        """Note how much was written so far."""
        self.lengths.append(len(self._terminal.getvalue()))
        self._left -= 1
        if not self._left:
            self._typed.send_text("q")

    def lines(self, _columns: int, _rows: int) -> Iterable[list[Cell]]:
        return [[Cell("still")]]

    def leave(self) -> None:
        """The screen has ended."""


def test_nothing_is_written_while_nothing_changes() -> None:
    terminal, keys = Terminal(), KeyBindings()
    bind_leaving(keys)
    with create_pipe_input() as typed:
        screen = Still(5, typed, terminal)
        with create_app_session(typed, Vt100_Output(terminal, lambda: Size(ROWS, COLUMNS), term="xterm")):
            show(Conversation(Output()), screen, keys, None)
    assert screen.lengths[0] < screen.lengths[1] == screen.lengths[4]
