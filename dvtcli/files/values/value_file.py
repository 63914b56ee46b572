"""Files of values over time, by the suffix, also in series: `run.parquet`, `run-0002.parquet`, …."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import join_some
from dvtcli.errors import UsageError
from dvtcli.files.values.value_rows import STREAM, WIDE, ParquetForm, PartFile, ValueRows, ValueWriter, stream_of
from dvtcli.watch.table import SignalRows

if TYPE_CHECKING:
    from dvtcli.files.values.parquet_file import Finished
    from dvtcli.files.values.parquet_values import LongTable, WideTable

#: a description of each form for users
FORMS = {".csv": "text", ".jsonl": "one JSON document a frame", ".parquet": "for DuckDB and pandas, needs pyarrow"}


def is_value_file(path: Path) -> bool:
    """Whether *path* has the suffix of a value file, not of a frame recording."""
    return path.suffix.lower() in FORMS


def checked_form(path: Path) -> str:
    """Return the form of *path*. Raises UsageError if its suffix is unknown, or its package is missing."""
    form = path.suffix.lower()
    if form not in FORMS:
        known = ", ".join(f"{suffix} ({what})" for suffix, what in FORMS.items())
        raise UsageError(
            f"{path.name}: values are written as {known}",
            hint=Hint(Action.LOG_VALUES, {"file": path.with_suffix(".csv")}, "writes values"),
        )
    if form == ".parquet":
        from dvtcli.files.values.parquet_values import pyarrow

        pyarrow()
    return form


def write_file(
    path: Path,
    rows: SignalRows,
    document: Callable[[Frame], dict[str, Any]],
    parquet: ParquetForm | None = None,
) -> ValueWriter:
    """Open a new file at *path* for live values; *document* converts a frame to JSON, *parquet* is of a .parquet.

    Raises UsageError as `checked_form`, SafetyRefusal if another process is writing it, OSError.
    """
    if checked_form(path) == ".parquet":
        from dvtcli.files.values.parquet_file import LiveParquet

        return LiveParquet(path, _table(rows, parquet or ParquetForm()))
    return _text_writer(path.suffix.lower(), path.open("w", encoding="utf-8", newline=""), rows, document)


class WholeFile:
    """A file that gets the name *path* when it is complete; arguments and errors as of `write_file`.

    Until then an old file of that name stays. A pipe is written directly.
    """

    def __init__(
        self,
        path: Path,
        rows: SignalRows,
        document: Callable[[Frame], dict[str, Any]],
        parquet: ParquetForm | None = None,
    ) -> None:
        form = checked_form(path)
        table = _table(rows, parquet or ParquetForm()) if form == ".parquet" else None
        self._part = PartFile(path)
        self._writer: ValueWriter
        if table is None:
            file = os.fdopen(os.dup(self._part.file.fileno()), "w", encoding="utf-8", newline="")
            self._writer = _text_writer(form, file, rows, document)
        else:
            from dvtcli.files.values.parquet_file import ParquetWriter

            self._writer = ParquetWriter(self._part.file, table)

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write a frame from *bus*."""
        self._writer.write(frame, bus)

    def complete(self, name: str = "") -> None:
        """Complete the file under *name* in its folder; empty: its own name. Raises OSError; then it is discarded."""
        try:
            self._writer.close()
            self._part.complete(name)
        except OSError:
            self._part.discard()
            raise

    def discard(self) -> None:
        """Remove what was written."""
        self._part.discard()


def _table(rows: SignalRows, form: ParquetForm) -> LongTable | WideTable:
    from dvtcli.files.values.parquet_values import LongTable, WideTable

    return WideTable(rows, form.origin) if form.layout == WIDE else LongTable(rows, form.origin)


def _text_writer(
    form: str, file: IO[str], rows: SignalRows, document: Callable[[Frame], dict[str, Any]]
) -> ValueWriter:
    if form == ".jsonl":
        from dvtcli.files.values.text_values import JsonlWriter

        return JsonlWriter(file, rows, document)
    from dvtcli.files.values.text_values import CsvWriter

    return CsvWriter(file, rows)


def read_values(path: Path) -> ValueRows:
    """Read the values in the file at *path*. Raises UsageError if missing, InputFileError if damaged."""
    form = checked_form(path)
    if form == ".parquet":
        from dvtcli.files.values.parquet_values import read_parquet

        return read_parquet(path)
    if form == ".jsonl":
        from dvtcli.files.values.text_values import read_jsonl

        return read_jsonl(path)
    from dvtcli.files.values.text_values import read_csv

    return read_csv(path)


@dataclass(frozen=True, slots=True)
class Rotation:
    """The limit of a file: *seconds* or *size_bytes*; 0 for no limit."""

    seconds: float = 0.0
    size_bytes: int = 0


class ValueParts:
    """Writes frames into files opened by *opened*, the first at *path*, the next by *rotation*.

    Use as a context manager: it completes the open file.
    """

    def __init__(self, path: Path, opened: Callable[[Path], ValueWriter], rotation: Rotation) -> None:
        self._path, self._opened, self._rotation = path, opened, rotation
        #: the files in order, and the bytes of complete files
        self.files: list[Path] = []
        self.size = 0
        self._open(path)

    def _open(self, path: Path) -> None:
        self.files.append(path)
        self._file: ValueWriter | None = self._opened(path)
        self._since_s, self._frames = monotonic(), 0

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write a frame."""
        assert self._file is not None  # noqa: S101 - nothing is written after a failure
        self._file.write(frame, bus)
        self._frames += 1

    def flush(self) -> None:
        """Flush to the system; begin a new file if due."""
        assert self._file is not None  # noqa: S101
        self._file.flush()
        if self._frames and self._is_full(self._file):
            self.close()
            self._open(next_part(self._path))

    def _is_full(self, file: ValueWriter) -> bool:
        seconds, most = self._rotation.seconds, self._rotation.size_bytes
        return bool((seconds and monotonic() - self._since_s >= seconds) or (most and file.size >= most))

    def close(self) -> None:
        """Complete the open file, if there is one. Raises OSError: then it is closed, too."""
        file, self._file = self._file, None
        if file is not None:
            file.close()
            self.size += file.size

    def kept(self) -> str:
        """Say which files have what was written until a failure; empty if none has."""
        said = [f"what was recorded is in {join_some(map(str, written))}"] if (written := _existing(self.files)) else []
        if _existing([stream_of(self.files[-1])]):
            said.append(f"the next log into {self._path} completes {self.files[-1].name}")
        return "; ".join(said)

    def __enter__(self) -> ValueParts:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _at: TracebackType | None
    ) -> None:
        try:
            self.close()
        except OSError:
            if error is None:  # else what ended the recording is the news
                raise


def _existing(paths: Iterable[Path]) -> list[Path]:
    return [path for path in paths if path.exists()]


def next_part(path: Path) -> Path:
    """Return the first free name of `run.parquet`, `run-0002.parquet`, … after all finished and unfinished files."""
    numbers = [number for number, _ in _parts(path, "_?", f"(?:{re.escape(path.suffix)}|{re.escape(STREAM)})")]
    return _part(path, max(numbers, default=0) + 1)


def finish_parts(path: Path) -> list[Finished]:
    """Complete files left by killed recordings into the .parquet file *path*; returns what has rows or is damaged.

    If a file of that name has another recording by now, the next free name is taken. Raises OSError, SafetyRefusal if
    another process writes such a file.
    """
    from dvtcli.files.values.parquet_file import finish

    found = (
        finish(stream, _part(path, number), lambda: next_part(path))
        for number, stream in sorted(_parts(path, "_", re.escape(STREAM)))
        if stream.is_file()  # a pipe of that name would be waited for
    )
    return [each for each in found if each is not None and (each.rows or each.aside)]


def _part(path: Path, number: int) -> Path:
    return path if number == 1 else path.with_name(f"{path.stem}-{number:04}{path.suffix}")


def _parts(path: Path, before: str, after: str) -> list[tuple[int, Path]]:
    """Return the numbered parts beside *path*; *before* and *after* are patterns around the stem."""
    names = re.compile(rf"{before}{re.escape(path.stem)}(?:-([0-9]{{4,9}}))?{after}")
    beside = [*path.parent.iterdir()] if path.parent.is_dir() else []
    return [(int(found[1] or 1), each) for each in beside if (found := names.fullmatch(each.name))]
