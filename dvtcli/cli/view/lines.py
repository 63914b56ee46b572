"""Lines of cells and tables, and their text for a stream: safe, coloured, in its characters."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, TextIO, TypeAlias

import click

from dvtcli.domain.hint import Hint
from dvtcli.domain.text import ascii_only, in_encoding, safe

if TYPE_CHECKING:
    from dvtcli.cli.view.typed_hints import TypedHints

#: Maximum width of screens on any terminal.
MAX_WIDTH = 100
#: Minimum width of a shrinking column.
_LEAST = 8


class Cell(NamedTuple):
    """A text with a style (a click colour name, or `bold`/`dim`); made safe on output."""

    text: str
    style: str = ""


#: The contents of a line; a hint is written for its call on output.
Line: TypeAlias = "str | Cell | Hint | Sequence[Cell | Hint]"


def part(text: str | Hint) -> Cell | Hint:
    """Convert *text* to a part of a line."""
    return Cell(text) if isinstance(text, str) else text


@dataclass(slots=True, eq=False, repr=False)
class Table:
    """Rows of cells in aligned columns; *right* are the right-aligned columns.

    *shrink* is the column, or several in order, to shorten if a row is too wide. *wraps*: wrap the last column instead.
    """

    header: Sequence[str] = ()
    right: frozenset[int] = frozenset()
    shrink: int | Sequence[int] | None = None
    indent: int = 2
    wraps: bool = False
    rows: list[Sequence[Cell]] = field(default_factory=list)

    def add(self, *cells: str | Cell) -> None:
        """Add a row."""
        self.rows.append([cell if isinstance(cell, Cell) else Cell(cell) for cell in cells])

    def lines(self, width: int = MAX_WIDTH) -> Iterable[list[Cell]]:
        """Return the rows as lines, within *width* columns if a column can shrink."""
        rows = [[Cell(safe(cell.text), cell.style) for cell in row] for row in self.rows]
        if self.header:
            rows.insert(0, [Cell(text, "dim") for text in self.header])
        most = max((len(row) for row in rows), default=0)
        widths = [max((columns(row[i].text) for row in rows if i < len(row)), default=0) for i in range(most)]
        self._fit(widths, width)
        return [self._line(part, widths) for row in rows for part in self._parts(row, widths)]

    def _parts(self, row: Sequence[Cell], widths: list[int]) -> Iterator[Sequence[Cell]]:
        """Return *row*, or as many rows as its last cell needs."""
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


#: common characters of one column: Latin, punctuation, arrows, boxes, blocks
_ONE_EACH = re.compile(r"[ -~\u00a0-\u00ac\u00ae-\u02ff\u2010-\u2027\u2190-\u22ff\u2500-\u25ff]*")


def columns(text: str) -> int:
    """Return the columns of *text*; control characters, replaced earlier by `safe`, count 0."""
    if _ONE_EACH.fullmatch(text):
        return len(text)
    from wcwidth import wcwidth

    return sum(max(0, wcwidth(sign)) for sign in text)


def clipped(text: str, width: int, mark: str = "…") -> str:
    """Cut *text* to *width* columns, with *mark* at the cut."""
    if columns(text) <= width:
        return text
    room = max(0, width - len(mark))
    kept = text[:room]
    while columns(kept) > room:
        kept = kept[:-1]
    return kept + mark[: max(1, width)]


def squeezed(text: str, width: int) -> str:
    """Cut *text* to *width* columns with `…` in the middle, so that both ends are visible."""
    if columns(text) <= width:
        return text
    begin = clipped(text, (width + 1) // 2)
    room, end = width - columns(begin), ""
    for sign in reversed(text):
        if columns(sign + end) > room:
            break
        end = sign + end
    return begin + end


#: blanks; a word, also with blanks in back-quotes
_PIECES = re.compile(r"\s+|(?:`[^`]*`|\S)+")
_WORDS = re.compile(r"\s+|\S+")


def pieces(text: str, width: int) -> Iterator[str]:
    """Split *text* where a line may be broken: blanks and words in turn.

    A command in back-quotes is one word if it fits in *width* columns: it can be copied.
    """
    for piece in _PIECES.findall(text):
        yield from [piece] if "`" not in piece or columns(piece) <= width else _WORDS.findall(piece)


def broken(text: str, width: int) -> list[str]:
    """Wrap *text* at *width* columns between the words of `pieces`; a wider word stays whole on its own line."""
    lines: list[str] = []
    for word in (piece for piece in pieces(text, width) if not piece.isspace()):
        if lines and columns(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines or [""]


#: Maximum length of a label, i.e. a first cell with the other cells aligned after it.
_WIDEST_LABEL = 14


def wrapped(cells: Sequence[Cell], width: int) -> Iterator[list[Cell]]:
    """Wrap *cells* at *width* characters between the words of `pieces`, with later lines indented like the first.

    A wider word stays whole on its own line.
    """
    if sum(columns(cell.text) for cell in cells) <= width:
        yield list(cells)
        return
    indent = _indent(cells)
    indent = indent if indent < width // 2 else 0
    line: list[Cell] = []
    used = 0
    for piece in _pieces(cells, width - indent):
        if used + columns(piece.text) <= width or used <= indent:
            line.append(piece)
            used += columns(piece.text)
        elif piece.text.isspace():
            used = width  # the blank that the line breaks at
        else:
            yield line
            line, used = [Cell(" " * indent), piece], indent + columns(piece.text)
    yield line


def _indent(cells: Sequence[Cell]) -> int:
    """Return the indent of later lines: after a label, else below the first word."""
    label = cells[0].text
    if len(cells) > 1 and label.endswith(" ") and len(label) <= _WIDEST_LABEL and label.strip():
        return len(label)
    text = "".join(cell.text for cell in cells)
    return len(text) - len(text.lstrip(" "))


def _pieces(cells: Sequence[Cell], width: int) -> Iterator[Cell]:
    for cell in cells:
        yield from (Cell(piece, cell.style) for piece in pieces(cell.text, width))


def with_hints(line: Line, hints: Callable[[], TypedHints]) -> str | Cell | Sequence[Cell]:
    """Return *line* with its hints as text, written by the result of *hints*."""
    if isinstance(line, str | Cell):
        return line
    parts = [line] if isinstance(line, Hint) else line
    if Hint not in map(type, parts):
        return parts  # type: ignore[return-value]  # cells
    return [part if isinstance(part, Cell) else Cell(hints().text(part)) for part in parts]


def painted(line: str | Cell | Sequence[Cell], stream: TextIO, *, colored: bool, plain: bool, width: int = 0) -> str:
    """The text of *line* for *stream*; *plain* asks for ASCII look-alikes, *width* (columns, 0: any) for wrapping."""
    cells: Sequence[Cell] = [Cell(line)] if isinstance(line, str) else [line] if isinstance(line, Cell) else line
    if width and sum(columns(cell.text) for cell in cells) > width:
        broken = wrapped([Cell(safe(cell.text), cell.style) for cell in cells], width)
        return "\n".join(painted(part, stream, colored=colored, plain=plain) for part in broken)
    text = "".join([_styled(cell) for cell in cells]) if colored else safe("".join([cell.text for cell in cells]))
    text = text.rstrip()
    if text.isascii():
        return text
    return ascii_only(text) if plain else _carried(stream, text)


def _styled(cell: Cell) -> str:
    if not cell.style or not cell.text.strip():
        return safe(cell.text)
    if cell.style in ("bold", "dim"):
        return click.style(safe(cell.text), **{cell.style: True})
    return click.style(safe(cell.text), fg=cell.style)


def _carried(stream: TextIO, text: str) -> str:
    """Encode *text* for the stream; files and pipes on Windows often lack characters."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return in_encoding(text, encoding)
    return text
