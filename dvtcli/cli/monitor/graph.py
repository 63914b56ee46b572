"""A signal's graph as lines of characters: braille dots, or stars in ASCII. Pure."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dvtcli.domain.text import safe
from dvtcli.errors import UsageError
from dvtcli.files.extras import extra
from dvtcli.watch.statistics import SHORTEST_S, Point
from dvtcli.watch.table import Track

#: The braille dot at (column, row) of a character of 2 x 4 dots (Unicode 10.0, chapter 21.1).
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_BRAILLE = 0x2800
#: Maximum characters of the numbers at the left, and of a column and its axis.
_LABEL = 11


@dataclass(slots=True)
class _Canvas:
    """Dots on *columns* x *rows* characters; (0, 0) is at the lower left."""

    columns: int
    rows: int
    plain: bool
    cells: list[list[int]]

    @classmethod
    def empty(cls, columns: int, rows: int, *, plain: bool) -> _Canvas:
        return cls(columns, rows, plain, [[0] * columns for _ in range(rows)])

    @property
    def width(self) -> int:
        return self.columns if self.plain else 2 * self.columns

    @property
    def height(self) -> int:
        return self.rows if self.plain else 4 * self.rows

    def rise(self, x: int, low: int, high: int) -> None:
        """Set the dots of column *x* from *low* to *high*."""
        for y in range(low, high + 1):
            down = self.height - 1 - y
            if self.plain:
                self.cells[down][x] = 1
            else:
                self.cells[down // 4][x // 2] |= _DOTS[x % 2][down % 4]

    def lines(self) -> list[str]:
        """The dots as text."""
        if self.plain:
            return ["".join("*" if cell else " " for cell in row) for row in self.cells]
        return ["".join(chr(_BRAILLE + cell) if cell else " " for cell in row) for row in self.cells]


def graph(
    points: Sequence[Point],
    width: int,
    height: int,
    span_s: tuple[float, float],
    *,
    ends: tuple[str, str],
    plain: bool,
) -> list[str]:
    """*points* within *span_s* (begin, end) on *width* x *height* characters; a value holds until the next one.

    *ends* are the words below the ends of the time axis.
    """
    canvas = _Canvas.empty(_columns(width), max(2, height - 2), plain=plain)
    begin_s, end_s = span_s
    shown = [point for point in points if begin_s <= point.time_s <= end_s]
    low = min((point.low for point in shown), default=0.0)
    high = max((point.high for point in shown), default=0.0)
    _draw(canvas, shown, span_s, (low, high))
    return _framed(canvas, low, high, ends)


def slots(width: int, *, plain: bool) -> int:
    """How many columns of dots a graph of *width* characters has: points of one column may be one point."""
    return _Canvas.empty(_columns(width), 0, plain=plain).width


def _columns(width: int) -> int:
    return max(8, width - _LABEL - 2)


def _draw(canvas: _Canvas, points: Sequence[Point], span_s: tuple[float, float], range_: tuple[float, float]) -> None:
    """Draw each column from minimum to maximum of its time, joined with the previous value."""
    (begin_s, end_s), (low, high) = span_s, range_
    length_s, span = max(end_s - begin_s, SHORTEST_S), high - low
    top = canvas.height - 1

    def y(value: float) -> int:
        return round((value - low) / span * top) if span > 0 else top // 2

    held: int | None = None
    filled = 0
    for point in points:
        x = min(canvas.width - 1, int((point.time_s - begin_s) / length_s * canvas.width))
        if held is not None:
            for between in range(filled, x):
                canvas.rise(between, held, held)
        reach = [y(point.low), y(point.high), *([held] if held is not None else [])]
        canvas.rise(x, min(reach), max(reach))
        held, filled = y(point.last), x + 1
    if held is not None:
        for between in range(filled, canvas.width):
            canvas.rise(between, held, held)


def number(value: float) -> str:
    """Return an axis label: a whole number if possible, at most ten characters."""
    text = f"{value:.0f}" if value == int(value) and abs(value) < 1e9 else f"{value:.4g}"
    return text[:10]


def _framed(canvas: _Canvas, low: float, high: float, ends: tuple[str, str]) -> list[str]:
    lines = canvas.lines()
    marks = {0: number(high), len(lines) - 1: number(low)} if high > low else {}
    if len(lines) >= 5 or not marks:
        marks[len(lines) // 2] = number((low + high) / 2)
    framed = [f"{marks.get(row, ''):>{_LABEL - 1}} │{line}" for row, line in enumerate(lines)]
    middle = canvas.columns - len(ends[0]) - len(ends[1])
    return [
        *framed,
        " " * _LABEL + "└" + "─" * canvas.columns,
        " " * (_LABEL + 1) + ends[0] + " " * max(1, middle) + ends[1],
    ]


SUFFIXES = (".png", ".svg", ".pdf")


def check_chart(path: Path) -> None:
    """Raise UsageError if *path* is not a picture format, or matplotlib is missing."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: pictures are {' '.join(SUFFIXES)}")
    extra("matplotlib", "plot", "drawing a picture")


def draw_chart(path: Path, tracks: Sequence[Track], begin_s: float) -> None:
    """Write *tracks*, one below the other over a common time axis, to *path*, whole or not at all."""
    with tempfile.TemporaryDirectory() as cache:
        extra("matplotlib", "plot", "drawing a picture").rcParams["svg.hashsalt"] = "dvtcli"
        figure_type = extra("matplotlib.figure", "plot", "drawing a picture").Figure
        figure = figure_type(figsize=(10, 1 + 2.2 * len(tracks)), layout="constrained")
        axes = figure.subplots(len(tracks), 1, sharex=True, squeeze=False)[:, 0]
        for axis, track in zip(axes, tracks, strict=True):
            points = track.points()
            axis.step([point.time_s - begin_s for point in points], [point.last for point in points], where="post")
            axis.set_title(safe(track.name).replace("$", r"\$"), loc="left", fontsize=9)
            axis.set_ylabel(safe(track.signal.unit).replace("$", r"\$"))
            axis.grid(visible=True, alpha=0.3)
        axes[-1].set_xlabel("time in s")
        draft = Path(cache) / f"draft{path.suffix.lower()}"
        figure.savefig(draft)
        try:
            path.write_bytes(draft.read_bytes())
        except OSError as failed:
            raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
