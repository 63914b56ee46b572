"""The text of frames with every bit named, and of the last exchange."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.typed_frame import frame_text
from dvtcli.operations.results.explained import FrameExplained, Traced


def explained_lines(result: FrameExplained, width: int) -> Iterator[Line]:
    """The frame, what it is, and a line for each of its parts."""
    yield [Cell(f"{frame_text(result.frame)}  "), Cell(result.what, "bold")]
    table = Table(("PLACE", "RAW", "NAME", "SAYS"), shrink=3)
    for part in result.parts:
        name = f"{part.name}  {part.object}" if part.object and part.object != part.name else part.name
        table.add(Cell(part.place, "dim"), part.raw_text, name, Cell(part.text, "bold"))
    yield from table.lines(width)


def trace_lines(result: Traced, _width: int) -> Iterator[Line]:
    """A line for each frame: when, whose, its bytes, and what it says in short."""
    began_s = result.frames[0].frame.frame.timestamp_s if result.frames else 0.0
    for frame in result.frames:
        at_ms = (frame.frame.frame.timestamp_s - began_s) * 1000
        yield [
            Cell(f"{at_ms:9.1f} ms  ", "dim"),
            Cell(f"{'->' if frame.sent else '<-'} {frame_text(frame.frame.frame):<20}  "),
            Cell(f"{frame.frame.what}  ", "bold"),
            Cell(frame.frame.short + ("  (its value is not shown)" if frame.secret else "")),
        ]
