"""The text of frames with every bit named."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.typed_frame import frame_text
from dvtcli.operations.results.explained import FrameExplained


def explained_lines(result: FrameExplained, width: int) -> Iterator[Line]:
    """The frame, what it is, and a line for each of its parts."""
    yield [Cell(f"{frame_text(result.frame)}  "), Cell(_what(result), "bold")]
    table = Table(("PLACE", "RAW", "NAME", "SAYS"), shrink=3)
    for part in result.parts:
        name = f"{part.name}  {part.object}" if part.object and part.object != part.name else part.name
        table.add(Cell(part.place, "dim"), part.raw_text, name, Cell(part.text, "bold"))
    yield from table.lines(width)


def _what(result: FrameExplained) -> str:
    kind = "remote request of " if result.frame.remote else ""
    return f"{kind}{result.label}{f', node {result.node}' if result.node else ''}"
