"""Shapes of signals: a value for each time since a signal began, from a formula or from the rows of a CSV file.

Knows numbers and seconds. Does not know objects, devices, or how a signal is written in one line.
"""

from __future__ import annotations

import csv
import math
import random
import re
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path

from dvtcli.files.input_file import read_input

Shape = Callable[[float], float]

_COLUMN = re.compile(r"[0-9]{1,4}")
#: A larger CSV file is no signal (bytes).
_MOST_BYTES = 16 << 20
#: a walk begins anew after so many steps
_MOST_STEPS = 100_000


def sine(amplitude: float, period_s: float) -> Shape:
    """Swings between -*amplitude* and *amplitude*, beginning with 0."""
    return lambda t_s: amplitude * math.sin(2 * math.pi * t_s / period_s)


def ramp(first: float, last: float, period_s: float) -> Shape:
    """Rises (or falls) from *first* to *last* in each period."""
    return lambda t_s: first + (last - first) * (t_s % period_s) / period_s


def square(one: float, other: float, period_s: float) -> Shape:
    """*one* for half of each period, then *other*."""
    return lambda t_s: one if t_s % period_s < period_s / 2 else other


def walk(step: float, lowest: float, highest: float, period_s: float) -> Shape:
    """Moves by up to *step* each period, within its limits, from their middle; the same way every time."""
    chance = random.Random(0)  # noqa: S311 (a simulation that can be repeated, no secret)
    values = [(lowest + highest) / 2]

    def value(t_s: float) -> float:
        steps = int(t_s / period_s)
        while len(values) <= min(steps, _MOST_STEPS):
            moved = values[-1] + chance.uniform(-step, step)
            values.append(min(highest, max(lowest, moved)))
        return values[steps % len(values)]

    return value


def rows(points: list[tuple[float, float]]) -> Shape:
    """Holds each value of *points* (time in s, value), in order of time, until the next one."""
    times = [time_s for time_s, _ in points]
    return lambda t_s: points[max(0, bisect_right(times, t_s) - 1)][1]


class RowsError(ValueError):
    """A CSV file has no rows that could be a signal; *place* is its path, with `:LINE` where a line is to blame."""

    def __init__(self, text: str, place: str) -> None:
        super().__init__(text)
        self.place = place


def read_rows(path: Path, column: str) -> list[tuple[float, float]]:
    """The times (s) and values of *column* in CSV file *path*; RowsError where there are none."""
    try:
        reader = csv.reader(_lines(path))
        numbered = [(reader.line_num, line) for line in reader if line]
    except (UnicodeError, csv.Error) as wrong:
        raise RowsError(f"no CSV file: {wrong}", str(path)) from wrong
    names = [name.strip() for name in numbered[0][1]] if numbered and not _is_number(numbered[0][1][0]) else []
    place = names.index(column) if column in names else int(column) if _COLUMN.fullmatch(column) else 0
    if numbered and place >= max(len(line) for _, line in numbered):
        place = 0  # a number beyond every row is no column either
    points = [(_cell(path, line, cells, 0), _cell(path, line, cells, place)) for line, cells in numbered[bool(names) :]]
    if not points or place == 0:
        known = f"; it has {', '.join(names[1:])}" if len(names) > 1 else ""
        raise RowsError(f"no column {column!r} with values; columns count from 1 after the time{known}", str(path))
    return sorted(points)


def _lines(path: Path) -> list[str]:
    """The lines of *path*; OSError if it cannot be opened, InputFileError if it is no file or too large."""
    return read_input(path, _MOST_BYTES, "file of a signal").decode("utf-8-sig").splitlines(keepends=True)


def _cell(path: Path, line: int, cells: list[str], place: int) -> float:
    try:
        value = float(cells[place])
    except (ValueError, IndexError):
        value = math.nan
    if not math.isfinite(value):
        raise RowsError("rows are a time in seconds and numbers", f"{path}:{line}")
    return value


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
