"""Lines of text over a full screen, scrolled by keys. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from dvtcli.cli.screen.choices import Cursor
from dvtcli.cli.view.lines import Cell


class TextDialog:
    """Shows *lines* until Esc, Enter, or the key *closes*."""

    def __init__(self, title: str, lines: Sequence[list[Cell]], closes: str = "") -> None:
        self._title, self._lines, self._closes = title, list(lines), closes
        self._cursor = Cursor()

    def press(self, key: str, text: str) -> bool:
        """Scroll; False once it is closed."""
        if key in ("escape", "enter", "c-c", self._closes) or text == "q":
            return False
        self._cursor.press(key, len(self._lines))
        return True

    def lines(self, _width: int, height: int) -> list[list[Cell]]:
        """Return the title, and the lines that fit."""
        shown = [self._lines[number] for number in self._cursor.window(len(self._lines), max(1, height - 1))]
        return [[Cell(self._title, "cyan"), Cell("   ↑↓ scroll  Esc back", "dim")], *shown]
