"""A list on a full screen: rows to choose from, and the rows that fit. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dvtcli.cli.view.lines import Cell

_STEPS = {"up": -1, "down": 1, "pageup": -10, "pagedown": 10, "wheel-up": -3, "wheel-down": 3}


class Cursor:
    """The chosen row of a list, and the first row shown."""

    def __init__(self, chosen: int = 0) -> None:
        self.chosen, self.top = chosen, 0

    def press(self, key: str, count: int) -> bool:
        """Move by a key in a list of *count* rows; False if the key moves nothing."""
        if key in _STEPS:
            self.chosen += _STEPS[key]
        elif key == "home":
            self.chosen = 0
        elif key == "end":
            self.chosen = count - 1
        else:
            return False
        self.chosen = max(0, min(count - 1, self.chosen))
        return True

    def window(self, count: int, height: int) -> range:
        """Return the numbers of the rows to show, of *count*, in *height* lines: the chosen row is among them."""
        self.chosen = max(0, min(count - 1, self.chosen))
        self.top = max(0, min(self.top, self.chosen, count - height))
        self.top = max(self.top, self.chosen - height + 1)
        return range(self.top, min(count, self.top + max(0, height)))


class Choices:
    """Asks which of *rows*, each with its letter and text; *done* gets the number of the chosen row."""

    def __init__(self, title: str, rows: Sequence[tuple[str, str]], done: Callable[[int], None]) -> None:
        self._title, self._rows, self._done = title, rows, done
        self._cursor = Cursor()

    def press(self, key: str, text: str) -> bool:
        """Move; Enter or a row's letter chooses, Esc and Ctrl-C close it."""
        if key in ("escape", "c-c"):
            return False
        letters = [letter for letter, _ in self._rows]
        if key == "enter" or (text and text in letters):
            self._done(self._cursor.chosen if key == "enter" else letters.index(text))
            return False
        self._cursor.press(key, len(self._rows))
        return True

    def lines(self, _width: int, height: int) -> list[list[Cell]]:
        """Return the title, and the rows that fit."""
        lines = [[Cell(self._title, "cyan"), Cell("   a letter or Enter: at once  Esc: no", "dim")]]
        for number in self._cursor.window(len(self._rows), height - 1):
            letter, text = self._rows[number]
            mark = "> " if number == self._cursor.chosen else "  "
            lines.append([Cell(f"  {mark}", "cyan"), Cell(letter, "bold"), Cell(f"  {text}")])
        return lines
