"""A line of text that is edited on a full screen. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from dvtcli.cli.view.lines import Cell

#: keys that move the cursor: the key, and the new place from the old one and the length
_MOVES: dict[str, Callable[[int, int], int]] = {
    "left": lambda place, _length: max(0, place - 1),
    "right": lambda place, length: min(length, place + 1),
    "home": lambda _place, _length: 0,
    "c-a": lambda _place, _length: 0,
    "end": lambda _place, length: length,
    "c-e": lambda _place, length: length,
}
#: characters kept of a pasted text
_LONGEST = 500


class Dialog(Protocol):
    """A part of a screen that takes all keys while it is open."""

    def press(self, key: str, text: str) -> bool:
        """Take a *key* with its *text*; False once the dialog is finished."""
        ...

    def lines(self, width: int, height: int) -> Iterable[list[Cell]]:
        """Return the picture for *width* columns and at most *height* rows."""
        ...


class Field:
    """A text with a cursor."""

    def __init__(self, text: str = "") -> None:
        self.text = text
        self.cursor = len(text)

    def press(self, key: str, text: str) -> bool:
        """Take an editing key, or *text* to insert; False if it is neither."""
        if key in _MOVES:
            self.cursor = _MOVES[key](self.cursor, len(self.text))
        elif key == "backspace":
            if self.cursor:
                self._replace(self.cursor - 1, self.cursor, "")
        elif key == "delete":
            self._replace(self.cursor, self.cursor + 1, "")
        elif key == "c-u":
            self._replace(0, self.cursor, "")
        elif key == "c-k":
            self._replace(self.cursor, len(self.text), "")
        elif key in ("paste", text) and (typed := " ".join(text.split("\n"))[:_LONGEST]).isprintable() and typed:
            self._replace(self.cursor, self.cursor, typed)
        else:
            return False
        return True

    def _replace(self, begin: int, end: int, text: str) -> None:
        self.text = self.text[:begin] + text + self.text[end:]
        self.cursor = begin + len(text)

    def cells(self, width: int = 0) -> list[Cell]:
        """Return the text with its cursor; the part around the cursor if it has more than *width* columns (0: any)."""
        begin = max(0, self.cursor - width + 2) if width else 0
        before, after = self.text[begin : self.cursor], self.text[self.cursor :]
        if not after:
            return [Cell(f"{before}_")]
        return [Cell(before), Cell(after[:1], "reverse"), Cell(after[1:])]


class FieldDialog:
    """Asks for a line with *label*; *done* gets the text and returns what is wrong with it, empty if nothing is."""

    def __init__(self, label: str, text: str, done: Callable[[str], str], help_text: str = "") -> None:
        self.field = Field(text)
        self._label, self._done, self._help = label, done, help_text
        self._wrong = ""

    def press(self, key: str, text: str) -> bool:
        """Edit; Enter is done unless the text is wrong, Esc and Ctrl-C close it."""
        if key in ("escape", "c-c"):
            return False
        if key == "enter":
            self._wrong = self._done(self.field.text.strip())
            return bool(self._wrong)
        if self.field.press(key, text):
            self._wrong = ""
        return True

    def lines(self, width: int, _height: int) -> list[list[Cell]]:
        """Return what is wrong, or the help, above the field."""
        note = Cell(self._wrong, "red") if self._wrong else Cell(self._help, "dim")
        keys = Cell("   Enter ok  Esc no", "dim")
        room = max(8, width - len(self._label) - 2 - len(keys.text))
        return [[note], [Cell(f"{self._label}: ", "cyan"), *self.field.cells(room), keys]]
