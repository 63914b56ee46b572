"""Values as CSV: a row for each frame, a column for each signal with its unit in the head."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import IO

from dvtcli.domain.datatypes import Value
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.times import utc
from dvtcli.errors import InputFileError
from dvtcli.files.values.column_heads import column_of
from dvtcli.files.values.opened_text import opened_text
from dvtcli.files.values.value_rows import ValueRows, size_of_open
from dvtcli.watch.table import SignalRows

#: heads of the first columns: `log` and `decode` write the first two, `read --every` the third
TIME, FRAME, SECONDS = "time", "frame", "time_s"


class CsvWriter:
    """Writes frames known to *rows* to *file*; writes the head at once."""

    def __init__(self, file: IO[str], rows: SignalRows) -> None:
        self._file = file
        self._rows = rows
        self.size = 0
        self._empty = [""] * len(rows.columns)
        self._csv = csv.writer(file, lineterminator="\n")
        self._csv.writerow([TIME, FRAME, *(no_formula(column.header) for column in rows.columns)])

    def write(self, frame: Frame, _bus: str = "") -> None:
        """Write a frame."""
        values = self._rows.values(frame)
        if values is None:
            return
        columns = self._rows.columns
        cells = [utc(frame.timestamp_s), no_formula(self._rows.head(frame)), *self._empty]
        for number, value in values:
            cells[number + 2] = csv_text(columns[number].cell(value))
        self._csv.writerow(cells)

    def flush(self) -> None:
        """Flush to the system."""
        self._file.flush()
        self.size = size_of_open(self._file)

    def close(self) -> None:
        """Close the file."""
        with self._file:
            self.flush()


def csv_text(value: Value | None) -> str:
    """A value as a cell: floats with all their digits, bytes as hex, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    if isinstance(value, str):
        return no_formula(value)
    return repr(value) if isinstance(value, float) else str(value)


def no_formula(text: str) -> str:
    """*text* as a cell that no spreadsheet takes for a formula: a device's name may be `=HYPERLINK(…)`."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


def read_csv(path: Path) -> ValueRows:
    """Read output of `log --decode`, `decode --csv` or `read --every -o`. Raises InputFileError for other files."""
    lines = _lines(path)
    head = _checked(path, 1, next(lines, []))
    first = 1 if head[:1] == [SECONDS] else 2
    if head[:2] != [TIME, FRAME] and first == 2:
        raise InputFileError(
            f"{path.name} begins with no time",
            place=f"{path}:1",
            hint=Hint(Action.LOG_VALUES, why="{} writes such files") + Hint(Action.READ_VALUES, why=", and so does {}"),
        )
    columns = [column_of(name) for name in head[first:]]
    return ValueRows(columns, _rows(path, lines, first, len(head)))


def _lines(path: Path) -> Iterator[list[str]]:
    reader = csv.reader(opened_text(path))
    try:
        yield from reader
    except csv.Error as wrong:  # a cell of more than 128 KiB
        raise InputFileError(
            f"{path.name} is no CSV file of values", place=f"{path}:{reader.line_num}", why=str(wrong)
        ) from wrong


def _rows(path: Path, lines: Iterator[list[str]], first: int, width: int) -> Iterator[tuple[float, list[float | None]]]:
    for number, row in enumerate(lines, 2):
        cells = _checked(path, number, row)
        if len(cells) != width:
            raise InputFileError(f"{len(cells)} cells, and the head has {width}", place=f"{path}:{number}")
        try:
            time_s = float(cells[0]) if first == 1 else datetime.fromisoformat(cells[0]).timestamp()
        except ValueError as wrong:
            raise InputFileError(f"{cells[0]!r} is no time", place=f"{path}:{number}") from wrong
        yield time_s, [_cell(text) for text in cells[first:]]


def _checked(path: Path, number: int, row: list[str]) -> list[str]:
    if any("\0" in cell for cell in row):
        raise InputFileError(f"{path.name} is no text", place=f"{path}:{number}")
    return row


def _cell(text: str) -> float | None:
    """A number; None for anything else: bytes and texts have no course."""
    if text in ("True", "False"):
        return float(text == "True")
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
