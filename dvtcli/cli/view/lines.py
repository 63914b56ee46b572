"""Columns and styles: what every screen is made of. Knows no results."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from dvtcli.cli.view.columns import broken, clipped, columns
from dvtcli.domain.safe_text import safe

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint


#: Screens are at most this wide, whatever the terminal.
MAX_WIDTH = 100
#: A column that gives way keeps as many signs.
_LEAST = 8


@dataclass(frozen=True, slots=True)
class Cell:
    """A piece of text with a style (a click colour name, or `bold`/`dim`); made safe when it is shown."""

    text: str
    style: str = ""


#: What a screen shows in one line; a hint is written for the call that it follows when it is shown.
Line: TypeAlias = "str | Cell | Hint | Sequence[Cell | Hint]"


def part(text: str | Hint) -> Cell | Hint:
    """*text* as a part of a line."""
    return Cell(text) if isinstance(text, str) else text


@dataclass(slots=True)
class Table:
    """Rows of cells in aligned columns; *right* names the columns that are aligned to the right.

    *shrink* is the column that gives way where a row is wider than the screen, or several, in that order. The last
    column *wraps* where that is said, instead of being cut.
    """

    header: Sequence[str] = ()
    right: frozenset[int] = frozenset()
    shrink: int | Sequence[int] | None = None
    indent: int = 2
    wraps: bool = False
    rows: list[Sequence[Cell]] = field(default_factory=list)

    def add(self, *cells: str | Cell) -> None:
        """Add one row."""
        self.rows.append([cell if isinstance(cell, Cell) else Cell(cell) for cell in cells])

    def lines(self, width: int = MAX_WIDTH) -> Iterable[list[Cell]]:
        """The rows as lines, no wider than *width* columns where a column can shrink."""
        rows = [[Cell(safe(cell.text), cell.style) for cell in row] for row in self.rows]
        if self.header:
            rows.insert(0, [Cell(text, "dim") for text in self.header])
        most = max((len(row) for row in rows), default=0)
        widths = [max((columns(row[i].text) for row in rows if i < len(row)), default=0) for i in range(most)]
        self._fit(widths, width)
        return [self._line(part, widths) for row in rows for part in self._parts(row, widths)]

    def _parts(self, row: Sequence[Cell], widths: list[int]) -> Iterator[Sequence[Cell]]:
        """*row*, or as many rows as its last cell needs."""
        if not self.wraps or len(row) < len(widths):
            yield row
            return
        for number, text in enumerate(broken(row[-1].text, widths[-1])):
            yield [*(Cell("") if number else cell for cell in row[:-1]), Cell(text, row[-1].style)]

    def _fit(self, widths: list[int], width: int) -> None:
        giving = (self.shrink,) if isinstance(self.shrink, int) else self.shrink or ()
        for column in giving:
            over = self.indent + sum(widths) + 2 * (len(widths) - 1) - width
            if column < len(widths) and over > 0:
                widths[column] = max(min(_LEAST, widths[column]), widths[column] - over)

    def _line(self, row: Sequence[Cell], widths: list[int]) -> list[Cell]:
        cells = [Cell(" " * self.indent)]
        for number, cell in enumerate(row):
            text = clipped(cell.text, widths[number])
            last = number == len(row) - 1
            padding = " " * (widths[number] - columns(text))
            before, after = (padding, "") if number in self.right else ("", "" if last else padding)
            cells += [Cell(before), Cell(text, cell.style), Cell(after if last else after + "  ")]
        return cells
