"""What a signal in the middle of a drawing leaves of the terminal: the screen from before."""

from __future__ import annotations

import gc
import signal
from collections.abc import Iterable
from io import StringIO

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.data_structures import Size
from prompt_toolkit.input import PipeInput, create_pipe_input
from prompt_toolkit.key_binding import KeyBindings
from prompt_toolkit.output.vt100 import Vt100_Output

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.screen.full_screen import bind_leaving, show
from dvtcli.cli.view.lines import Cell
from dvtcli.cli.view.output import Output
from tests.posix import STOPPING


class Struck(StringIO):
    """A terminal that the signal *number* comes to with what is written to it for the *drawing*-th time."""

    def __init__(self, number: int, drawing: int) -> None:
        super().__init__()
        self._number, self._drawing = number, drawing

    def write(self, text: str) -> int:
        written = super().write(text)
        self._drawing -= "drawn" in text
        if not self._drawing and "drawn" in text:
            signal.raise_signal(self._number)
        return written


class Counting:
    """A screen that is another one each time; *left* says that it has ended."""

    def __init__(self) -> None:
        self._drawings = 0
        self.left = False

    def gather(self) -> None:
        """Nothing is new."""

    def lines(self, _columns: int, _rows: int) -> Iterable[list[Cell]]:
        self._drawings += 1
        return [[Cell("x" * self._drawings + "drawn")]]

    def leave(self) -> None:
        self.left = True


def stop(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("number", STOPPING)
@pytest.mark.parametrize("drawing", [1, 2])
def test_the_screen_from_before_is_back(number: int, drawing: int) -> None:
    terminal, screen, keys = Struck(number, drawing), Counting(), KeyBindings()
    bind_leaving(keys)
    before = signal.signal(number, stop)
    try:
        with create_pipe_input() as typed:
            output = Vt100_Output(terminal, lambda: Size(24, 80), term="xterm")
            with create_app_session(typed, output):
                if number == signal.SIGINT:  # leaves the screen alone
                    show(Conversation(Output()), screen, keys, None)
                else:
                    with pytest.raises(KeyboardInterrupt):
                        show(Conversation(Output()), screen, keys, None)
        assert signal.getsignal(number) is stop
    finally:
        signal.signal(number, before)
    assert screen.left
    assert terminal.getvalue().rpartition("\x1b[?1049h")[2].count("\x1b[?1049l") == 1


class Typing(Counting):
    """A screen on which a key is pressed at each picture, and q at the last of them."""

    pictures = 120

    def __init__(self, typed: PipeInput) -> None:
        super().__init__()
        self._typed = typed

    def lines(self, columns: int, rows: int) -> Iterable[list[Cell]]:
        (line,) = super().lines(columns, rows)
        self._typed.send_text("a" if self._drawings < self.pictures else "q")
        return [line, *([Cell("." * columns)] for _ in range(rows - 1))]


def test_what_pictures_leave_behind_is_collected_in_small_parts() -> None:
    """A key waits for no collection of many pictures, nor of objects from before the screen; then all is as before."""
    gc.unfreeze()
    before, collected = gc.get_threshold(), list[int]()

    def collect(phase: str, info: dict[str, int]) -> None:
        if phase == "stop":
            collected.append(info["collected"])

    keys = KeyBindings()
    bind_leaving(keys)
    keys.add("a")(lambda _event: None)
    gc.set_threshold(100_000)  # as the program has it
    gc.callbacks.append(collect)
    try:
        with create_pipe_input() as typed:
            output = Vt100_Output(StringIO(), lambda: Size(40, 120), term="xterm")
            with create_app_session(typed, output):
                show(Conversation(Output()), Typing(typed), keys, None, lambda *_act: None)
        assert gc.get_threshold()[0] == 100_000
        assert gc.get_freeze_count() == 0
    finally:
        gc.callbacks.remove(collect)
        gc.set_threshold(*before)
    assert sum(collected) > 5_000
    assert max(collected) < 30_000
