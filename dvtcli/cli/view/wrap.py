"""Lines that are wider than the terminal, broken between words. Knows no results."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from dvtcli.cli.view.columns import columns
from dvtcli.cli.view.lines import Cell

#: A first cell of at most this many characters is a label: what follows it hangs beside it.
_WIDEST_LABEL = 14
_PIECES = re.compile(r"\s+|\S+")


def wrapped(cells: Sequence[Cell], width: int) -> Iterator[list[Cell]]:
    """*cells* on lines of at most *width* characters, later ones indented as the first; words are never cut.

    A word that is wider than the screen stands on a line of its own, as long as it is.
    """
    if sum(columns(cell.text) for cell in cells) <= width:
        yield list(cells)
        return
    indent = _indent(cells)
    indent = indent if indent < width // 2 else 0
    line: list[Cell] = []
    used = 0
    for piece in _pieces(cells):
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
    """Where later lines begin: beside a label, else below the first word."""
    label = cells[0].text
    if len(cells) > 1 and label.endswith(" ") and len(label) <= _WIDEST_LABEL and label.strip():
        return len(label)
    text = "".join(cell.text for cell in cells)
    return len(text) - len(text.lstrip(" "))


def _pieces(cells: Sequence[Cell]) -> Iterator[Cell]:
    for cell in cells:
        for match in _PIECES.finditer(cell.text):
            yield Cell(match[0], cell.style)
