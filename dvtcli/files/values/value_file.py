"""Files of values over time, in the form given by the suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.files.values.value_rows import WIDE, ParquetForm, ValueRows, ValueWriter
from dvtcli.watch.table import SignalRows

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
    """Open a new file at *path*; *document* converts a frame to JSON, *parquet* is the form of .parquet.

    Raises UsageError as `checked_form`, OSError.
    """
    form = checked_form(path)
    if form == ".parquet":
        from dvtcli.files.values.parquet_file import ParquetWriter
        from dvtcli.files.values.parquet_values import LongTable, WideTable

        chosen = parquet or ParquetForm()
        table = WideTable(rows, chosen.origin) if chosen.layout == WIDE else LongTable(rows, chosen.origin)
        return ParquetWriter(path, table, live=chosen.live)
    file = path.open("w", encoding="utf-8", newline="")
    if form == ".jsonl":
        from dvtcli.files.values.jsonl_values import JsonlWriter

        return JsonlWriter(file, rows, document)
    from dvtcli.files.values.csv_values import CsvWriter

    return CsvWriter(file, rows)


def read_values(path: Path) -> ValueRows:
    """Read the values in the file at *path*. Raises UsageError if missing, InputFileError if damaged."""
    form = checked_form(path)
    if form == ".parquet":
        from dvtcli.files.values.parquet_values import read_parquet

        return read_parquet(path)
    if form == ".jsonl":
        from dvtcli.files.values.jsonl_values import read_jsonl

        return read_jsonl(path)
    from dvtcli.files.values.csv_values import read_csv

    return read_csv(path)
