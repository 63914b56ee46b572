"""A line's cells as the text that goes to a stream: made safe, coloured, in characters the stream can carry."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, TextIO

import click

from dvtcli.cli.view.lines import Cell, Line, columns, pieces
from dvtcli.domain.hint import Hint
from dvtcli.domain.text import ascii_only, in_encoding, safe

if TYPE_CHECKING:
    from dvtcli.cli.view.typed_hints import TypedHints


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
