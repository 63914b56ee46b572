"""Values as JSON lines: `dvtcli.frame/1`, a document per frame, raw and physical values side by side."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, Any

from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.errors import InputFileError
from dvtcli.files.input_file import json_line
from dvtcli.files.values.opened_text import opened_text
from dvtcli.files.values.value_rows import ValueRows, size_of_open
from dvtcli.watch.decoder import Signal
from dvtcli.watch.table import Column, SignalRows

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
    return ValueRows(list(columns.values()), _rows(path, numbers))


def _rows(path: Path, columns: dict[_Name, int]) -> Iterator[tuple[float, list[float | None]]]:
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
