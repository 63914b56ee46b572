"""The text of frames with every bit named, and of the last exchange."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.typed_frame import frame_text
from dvtcli.operations.results.explained import FrameExplained, Traced


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


#: what is in a frame for the protocol's sake
_ASIDE = frozenset({"index", "reserved", "n: bytes without data", "e: transfer type", "s: size", "without data", "c"})


def trace_lines(result: Traced, _width: int) -> Iterator[Line]:
    """A line for each frame: when, whose, its bytes, and what it says in short."""
    began_s = result.frames[0].frame.frame.timestamp_s if result.frames else 0.0
    for one in result.frames:
        at_ms = (one.frame.frame.timestamp_s - began_s) * 1000
        yield [
            Cell(f"{at_ms:9.1f} ms  ", "dim"),
            Cell(f"{'->' if one.sent else '<-'} {frame_text(one.frame.frame):<20}  "),
            Cell(f"{_what(one.frame)}  ", "bold"),
            Cell(", ".join(_short(one.frame)) + ("  (its value is not shown)" if one.secret else "")),
        ]


def _short(one: FrameExplained) -> Iterator[str]:
    """What a frame says in one line: its service's word, its object, its value; not the protocol's own bits."""
    for part in one.parts:
        words = f"{part.object} {part.text}".strip()
        if words and not part.in_id and part.name not in _ASIDE:
            yield words
