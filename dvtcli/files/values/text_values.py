"""Values as text: CSV with a column for each signal, and JSON lines."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable, Iterator
from datetime import datetime
from functools import lru_cache
from io import TextIOWrapper
from pathlib import Path
from typing import IO, Any

from dvtcli.domain.datatypes import Value
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.domain.times import utc
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import json_line, open_input
from dvtcli.files.values.value_rows import ValueRows, size_of_open
from dvtcli.watch.decoder import Signal
from dvtcli.watch.table import Column, SignalRows

#: heads of the first columns: `log` and `decode` write the first two, `read --every` the third
TIME, FRAME, SECONDS = "time", "frame", "time_s"


class CsvWriter:
    """Writes frames known to *rows* to *file*; writes the head at once."""

    def __init__(self, file: IO[str], rows: SignalRows) -> None:
        self._file = file
        self._rows = rows
        self.size = 0
        self._cells = [column.cell for column in rows.columns]
        self._empty = [""] * len(rows.columns)
        self._without_values = "," * len(rows.columns) + "\n"
        heads = [_quoted(no_formula(column.header)) for column in rows.columns]
        file.write(",".join([TIME, FRAME, *heads]) + "\n")

    def write(self, frame: Frame, _bus: str = "") -> None:
        """Write a frame."""
        values = self._rows.values(frame)
        if values is None:
            return
        row = f"{utc(frame.timestamp_s)},{_name_cell(self._rows.head(frame))}"
        if not values:
            self._file.write(row + self._without_values)
            return
        cells = self._empty.copy()
        for number, value in values:
            cells[number] = _quoted(csv_text(self._cells[number](value)))
        self._file.write(f"{row},{','.join(cells)}\n")

    def flush(self) -> None:
        """Flush to the system."""
        self._file.flush()
        self.size = size_of_open(self._file)

    def close(self) -> None:
        """Close the file."""
        with self._file:
            self.flush()


@lru_cache(maxsize=1024)
def _name_cell(name: str) -> str:
    return _quoted(no_formula(name))


def _quoted(cell: str) -> str:
    """*cell* in quotes if RFC 4180 wants them."""
    if "," in cell or '"' in cell or "\n" in cell or "\r" in cell:
        return '"' + cell.replace('"', '""') + '"'
    return cell


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
    return ValueRows(columns, _csv_rows(path, lines, first, len(head)))


def _lines(path: Path) -> Iterator[list[str]]:
    reader = csv.reader(opened_text(path))
    try:
        yield from reader
    except csv.Error as wrong:  # a cell of more than 128 KiB
        raise InputFileError(
            f"{path.name} is not a CSV file of values", place=f"{path}:{reader.line_num}", why=str(wrong)
        ) from wrong


def _csv_rows(
    path: Path, lines: Iterator[list[str]], first: int, width: int
) -> Iterator[tuple[float, list[float | None]]]:
    for number, row in enumerate(lines, 2):
        cells = _checked(path, number, row)
        if len(cells) != width:
            raise InputFileError(f"{len(cells)} cells, but the header has {width}", place=f"{path}:{number}")
        try:
            time_s = float(cells[0]) if first == 1 else datetime.fromisoformat(cells[0]).timestamp()
        except ValueError as wrong:
            raise InputFileError(f"{cells[0]!r} is not a time", place=f"{path}:{number}") from wrong
        yield time_s, [_cell(text) for text in cells[first:]]


def _checked(path: Path, number: int, row: list[str]) -> list[str]:
    if any("\0" in cell for cell in row):
        raise InputFileError(f"{path.name} is not text", place=f"{path}:{number}")
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


_SCHEMA = "dvtcli.frame/1"
_Name = tuple[str, str]


class JsonlWriter:
    """Writes frames known to *rows* to *file*, in the form of *document*."""

    def __init__(self, file: IO[str], rows: SignalRows, document: Callable[[Frame], dict[str, Any]]) -> None:
        self._file, self._rows, self._document = file, rows, document
        self.size = 0

    def write(self, frame: Frame, _bus: str = "") -> None:
        """Write a frame."""
        if self._rows.row(frame) is not None:
            self._file.write(json.dumps(self._document(frame), ensure_ascii=False, separators=(",", ":")) + "\n")

    def flush(self) -> None:
        """Flush to the system."""
        self._file.flush()
        self.size = size_of_open(self._file)

    def close(self) -> None:
        """Close the file."""
        with self._file:
            self.flush()


def read_jsonl(path: Path) -> ValueRows:
    """Read output of `log run.jsonl --decode`, or of `monitor` and `decode` with --json; skips other documents.

    Reads the file twice, first for the columns. Raises InputFileError, with the line, if malformed.
    """
    columns: dict[_Name, Column] = {}
    for document in _documents(path):
        for name, shown in _numbers(document):
            if name not in columns:
                place = _object(document, name[1])
                signal = Signal(name[1], name[1], place, Scaling(str(shown.get("unit", ""))))
                said = "" if name[1].startswith(place) else place
                columns[name] = Column(" ".join(filter(None, (name[0], said, name[1]))), signal)
    numbers = {name: number for number, name in enumerate(columns)}
    return ValueRows(list(columns.values()), _file_rows(path, numbers))


def _file_rows(path: Path, columns: dict[_Name, int]) -> Iterator[tuple[float, list[float | None]]]:
    for document in _documents(path):
        cells: list[float | None] = [None] * len(columns)
        for name, shown in _numbers(document):
            cells[columns[name]] = shown["value"]
        yield datetime.fromisoformat(document["time"]).timestamp(), cells


def _numbers(document: dict[str, Any]) -> Iterator[tuple[_Name, dict[str, Any]]]:
    """Iterate over a frame's numbers: name, and physical value and unit, else the raw value."""
    pdo, node = document.get("pdo"), document.get("node")
    title = f"{str(pdo).upper()} node {node}" if pdo else ""
    physical = document.get("physical") or {}
    for key, raw in document["signals"].items():
        shown = physical.get(key) or {}
        if isinstance(shown.get("value"), int | float):
            yield (title, key), shown
        elif isinstance(raw, int | float):
            yield (title, key), {"value": float(raw)}


def _object(document: dict[str, Any], key: str) -> str:
    """Return a signal's object; empty in documents of older versions."""
    objects = document.get("objects")
    return str(objects.get(key, "")) if isinstance(objects, dict) else ""


def _documents(path: Path) -> Iterator[dict[str, Any]]:
    for number, line in enumerate(opened_text(path), 1):
        if not line.strip():
            continue
        try:
            document = json.loads(line)
            if document["schema"] == _SCHEMA:
                datetime.fromisoformat(document["time"])
                _ = document["signals"].items()
                yield document
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as wrong:
            place, text = f"{path}:{number}", f"no {_SCHEMA} document"
            json_line(line, place, text)  # of what is no JSON it says where
            raise InputFileError(text, place=place) from wrong


def opened_text(path: Path) -> Iterator[str]:
    """Iterate over lines of *path*. Raises UsageError if absent, InputFileError if not UTF-8."""
    try:
        with TextIOWrapper(open_input(path), encoding="utf-8-sig", newline="") as file:
            yield from file
    except OSError as failed:
        raise UsageError(
            f"{path}: {failed.strerror or failed}", hint=Hint(Action.LOG_VALUES, {"file": path}, "records one")
        ) from failed
    except UnicodeDecodeError as wrong:
        raise InputFileError(f"{path.name} is not UTF-8 text", place=str(path)) from wrong


_HEAD = re.compile(r"(?P<name>.*?)(?: \[(?P<unit>[^\[\]]*)\])?", re.S)
_OF_PDO = re.compile(r"[TR]PDO\d{1,3} node \d{1,3} (?P<key>.*)", re.S)
_OBJECT = re.compile(r"(?:\d{1,3}:)?(?P<object>[0-9A-F]{4}:[0-9A-F]{2})(?: (?P<name>.*))?", re.S)


def column_of(head: str) -> Column:
    """Return the column for *head*: its signal's name, object and unit, as far as given."""
    match = _HEAD.fullmatch(head)
    name, unit = (match["name"], match["unit"] or "") if match else (head, "")
    of_pdo = _OF_PDO.fullmatch(name)
    key = of_pdo["key"] if of_pdo else name.partition(" ")[2] or name
    object_ = _OBJECT.fullmatch(key) or _OBJECT.fullmatch(name)
    if object_ is not None:
        key = object_["name"] or object_["object"]
    return Column(name, Signal(key, key, object_["object"] if object_ else "", Scaling(unit)))
