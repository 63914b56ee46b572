"""A field, a list, a question and a text on a full screen. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Protocol

from dvtcli.cli.view.lines import Cell, broken, clipped, columns
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.text import ascii_only, safe

#: what the style of a cell ends with if the terminal's cursor stands there, which screen readers follow
CURSOR = "+"
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

    def click(self, row: int) -> bool:
        """Take a click on *row* of its lines; True if it means Enter."""
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
            return [Cell(before), Cell("_", CURSOR)]
        return [Cell(before), Cell(after[:1], f"reverse{CURSOR}"), Cell(after[1:])]


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

    def click(self, row: int) -> bool:  # noqa: ARG002 - as every dialog
        """Do nothing: the field has one line."""
        return False

    def lines(self, width: int, _height: int) -> list[list[Cell]]:
        """Return what is wrong, or the help, above the field."""
        note, style = (self._wrong, "red") if self._wrong else (self._help, "dim")
        notes = [[Cell(row, style)] for row in broken(note, max(8, width)) or [""]]
        keys = Cell("   Enter ok  Esc no", "dim")
        room = max(8, width - len(self._label) - 2 - len(keys.text))
        return [*notes, [Cell(f"{self._label}: ", "cyan"), *self.field.cells(room), keys]]


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

    def click(self, row: int, count: int) -> bool:
        """Choose the row that is shown as the window's *row*, if there is one of *count*; True if it was chosen."""
        before = self.chosen
        if row < 0 or self.top + row >= count:
            return False
        self.chosen = self.top + row
        return self.chosen == before

    def window(self, count: int, height: int) -> range:
        """Return the numbers of the rows to show, of *count*, in *height* lines: the chosen row is among them."""
        self.chosen = max(0, min(count - 1, self.chosen))
        self.top = max(0, min(self.top, self.chosen, count - height))
        self.top = max(self.top, self.chosen - height + 1)
        return range(self.top, min(count, self.top + max(0, height)))


class Choices:
    """Asks which of *rows*, each with its letter (a blank: none) and text; *done* gets the number of the chosen row."""

    def __init__(self, title: str, rows: Sequence[tuple[str, str]], done: Callable[[int], None]) -> None:
        self._title, self._rows, self._done = title, rows, done
        self._cursor = Cursor()

    def press(self, key: str, text: str) -> bool:
        """Move; Enter or a row's letter chooses, Esc and Ctrl-C close it."""
        if key in ("escape", "c-c"):
            return False
        letters = [letter for letter, _ in self._rows]
        if key == "enter" or (text.strip() and text in letters):
            self._done(self._cursor.chosen if key == "enter" else letters.index(text))
            return False
        self._cursor.press(key, len(self._rows))
        return True

    def click(self, row: int) -> bool:
        """Move to the clicked row; a click on the chosen row is Enter."""
        return self._cursor.click(row - 1, len(self._rows))

    def lines(self, _width: int, height: int) -> list[list[Cell]]:
        """Return the title, and the rows that fit."""
        lines = [[Cell(self._title, "cyan"), Cell("   a letter or Enter: at once  Esc: no", "dim")]]
        for number in self._cursor.window(len(self._rows), height - 1):
            letter, text = self._rows[number]
            mark = "> " if number == self._cursor.chosen else "  "
            style = f"cyan{CURSOR}" if number == self._cursor.chosen else "cyan"
            lines.append([Cell(f"  {mark}", style), Cell(letter, "bold"), Cell(f"  {text}")])
        return lines


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

    def click(self, row: int) -> bool:  # noqa: ARG002 - as every dialog
        """Do nothing: a click is not an answer."""
        return False

    def lines(self, width: int, height: int) -> list[list[Cell]]:
        """Return the question, its end if it is longer than *height* rows."""
        rows = broken(f"{self._text} [y/N]", max(8, width))[-max(1, height) :]
        return [[Cell(row, "yellow" if number else f"yellow{CURSOR}")] for number, row in enumerate(rows)]


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

    def click(self, row: int) -> bool:  # noqa: ARG002 - as every dialog
        """Do nothing: the lines are only read."""
        return False

    def lines(self, _width: int, height: int) -> list[list[Cell]]:
        """Return the title, and the lines that fit."""
        shown = [self._lines[number] for number in self._cursor.window(len(self._lines), max(1, height - 1))]
        return [[Cell(self._title, f"cyan{CURSOR}"), Cell("   ↑↓ scroll  Esc back", "dim")], *shown]


#: numbers of significant digits to try for a long number, highest first
_DIGITS = (6, 5, 4, 3, 2)


def cut(line: list[Cell], width: int, *, plain: bool) -> list[Cell]:
    """Return *line*, made safe and cut to *width* columns, with `…` at a cut.

    *plain*: in ASCII, in which a replacement may take more columns.
    """
    shown = [Cell(_shown(cell.text, plain=plain), cell.style) for cell in line]
    left = _clipped("".join(cell.text for cell in shown).rstrip(), width, plain=plain)
    cells: list[Cell] = []
    for cell in shown:
        part, left = left[: len(cell.text)], left[len(cell.text) :]
        if part:
            cells.append(Cell(part, cell.style))
    return cells


def wide(groups: Sequence[list[Cell]], *, plain: bool) -> int:
    """Return the columns of *groups* on a line."""
    return columns("".join(_shown(cell.text, plain=plain) for group in groups for cell in group).rstrip())


def filled(text: str, width: int, *, plain: bool) -> str:
    """*text* made safe, cut or filled up to *width* columns; *plain*: in ASCII."""
    kept = _clipped(_shown(text, plain=plain), width, plain=plain)
    return kept + " " * (width - columns(kept))


def least_and_most(meaning: Scaling, low: float, high: float, width: int) -> str:
    """Return minimum and maximum of raw values in *width* columns: rounded with `~`, or `…`, if too long."""
    whole = f"{meaning.number_text(low)} .. {meaning.number_text(high)}"
    if len(whole) <= width:
        return whole
    for digits in _DIGITS:
        least, most = (_rounded(meaning.to_physical(raw), digits) for raw in (low, high))
        if len(least) + len(most) + 5 <= width:
            return f"~{least} .. {most}"
    return "…"


def _rounded(number: float | Fraction, digits: int) -> str:
    mantissa, _, exponent = f"{float(number):.{digits}g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def _shown(text: str, *, plain: bool) -> str:
    return ascii_only(safe(text)) if plain else safe(text)


def _clipped(text: str, width: int, *, plain: bool) -> str:
    return clipped(text, width, "..." if plain else "…")
