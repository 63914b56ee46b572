"""Files of values over time, in the form given by the suffix."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.files.values.part_file import PartFile
from dvtcli.files.values.value_rows import WIDE, ParquetForm, ValueRows, ValueWriter
from dvtcli.watch.table import SignalRows

if TYPE_CHECKING:
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
