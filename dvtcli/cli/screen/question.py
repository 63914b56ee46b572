"""A question on a full screen, answered by a key. Pure."""

from __future__ import annotations

from collections.abc import Callable

from dvtcli.cli.view.columns import broken
from dvtcli.cli.view.lines import Cell


class Question:
    """Asks *text*; *answered* gets the answer. Only `y` is yes, as at the prompt."""

    def __init__(self, text: str, answered: Callable[[bool], None]) -> None:
        self._text, self._answered = text, answered

    def press(self, key: str, text: str) -> bool:
        """Take `y` for yes; `n`, Enter, Esc and Ctrl-C for no."""
        if text.lower() == "y" or text.lower() == "n" or key in ("enter", "escape", "c-c"):
            self._answered(text.lower() == "y")
            return False
        return True

    def lines(self, width: int, height: int) -> list[list[Cell]]:
        """Return the question, its end if it is longer than *height* rows."""
        rows = broken(f"{self._text} [y/N]", max(8, width))
        return [[Cell(row, "yellow")] for row in rows[-max(1, height) :]]
