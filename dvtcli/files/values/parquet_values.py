"""Values as Apache Parquet, through pyarrow, which is an optional extra: a column for each signal, with its unit.

Rows are written in groups; a file whose writer was killed has no end, and cannot be read. Knows no bus.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dvtcli.domain.datatypes import Kind, Value
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.extras import extra
from dvtcli.files.values.column_heads import column_of
from dvtcli.files.values.csv_values import FRAME, TIME
from dvtcli.files.values.value_rows import ValueRows
from dvtcli.watch.table import Column, SignalRows

#: rows that are kept back until they are written together
_GROUP = 20_000


def needed() -> None:
    """UsageError where pyarrow is missing."""
    extra("pyarrow", "parquet", "a .parquet file")


class ParquetWriter:
    """Writes the frames that *rows* knows to a new file at *path*."""

    def __init__(self, path: Path, rows: SignalRows) -> None:
        self._arrow = extra("pyarrow", "parquet", "a .parquet file")
        self._rows = rows
        self._schema = self._schema_of(rows.columns)
        self._file = extra("pyarrow.parquet", "parquet", "a .parquet file").ParquetWriter(str(path), self._schema)
        self._times: list[int] = []
        self._titles: list[str] = []
        self._cells: list[list[Value | None]] = []

    def _schema_of(self, columns: list[Column]) -> Any:
        arrow = self._arrow
        fields = [arrow.field(TIME, arrow.timestamp("us", tz="UTC")), arrow.field(FRAME, arrow.string())]
        for column in columns:
            about = {"unit": column.signal.unit, "object": column.signal.object}
            kind = getattr(arrow, _kind(column))()
            fields.append(arrow.field(column.header, kind, metadata={key: said for key, said in about.items() if said}))
        return arrow.schema(fields)

    def write(self, frame: Frame) -> None:
        """Write one frame."""
        cells = self._rows.row(frame)
        if cells is None:
            return
        self._times.append(round(frame.timestamp_s * 1_000_000))
        self._titles.append(self._rows.title(frame))
        self._cells.append(cells)
        if len(self._times) >= _GROUP:
            self._write_group()

    def _write_group(self) -> None:
        if not self._times:
            return
        kinds = [_kind(column) for column in self._rows.columns]
        columns = [[_cell(row[at], kind) for row in self._cells] for at, kind in enumerate(kinds)]
        arrays = [
            self._arrow.array(values, type=field.type)
            for values, field in zip([self._times, self._titles, *columns], self._schema, strict=True)
        ]
        self._file.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        self._times, self._titles, self._cells = [], [], []

    def flush(self) -> None:
        """Nothing: rows are written in groups."""

    def close(self) -> None:
        """Write what is kept back, and the end."""
        self._write_group()
        self._file.close()


def _kind(column: Column) -> str:
    """The type of a column's cells, as pyarrow calls it."""
    signal = column.signal
    if signal.meaning.is_scaled or not signal.object:
        return "float64"  # also of a DBC file, whose values are scaled already
    if signal.data_type is None:
        return "uint64" if signal.bits <= 64 else "string"
    kinds = {Kind.BOOLEAN: "bool_", Kind.INTEGER: "int64", Kind.UNSIGNED: "uint64", Kind.REAL: "float64"}
    return kinds.get(signal.data_type.kind, "string")


def _cell(value: Value | None, kind: str) -> object:
    if value is None or kind == "string":
        return None if value is None else value.hex(" ").upper() if isinstance(value, bytes) else str(value)
    return float(value) if kind == "float64" and isinstance(value, int | float) else value


def read_parquet(path: Path) -> ValueRows:
    """What `log run.parquet --decode` wrote; InputFileError where it is none of these, or has no end."""
    arrow = extra("pyarrow", "parquet", "a .parquet file")
    if not path.is_file():
        raise UsageError(f"{path}: no such file", hint=Hint(Action.LOG_VALUES, {"file": path}, "records one"))
    try:
        file = extra("pyarrow.parquet", "parquet", "a .parquet file").ParquetFile(str(path))
    except (arrow.ArrowException, OSError) as wrong:
        why = str(wrong).partition("\n")[0]
        raise InputFileError(f"{path.name} is no whole Parquet file", why=why, place=str(path)) from wrong
    names = file.schema_arrow.names
    if TIME not in names or not arrow.types.is_timestamp(file.schema_arrow.field(TIME).type):
        raise InputFileError(f"{path.name} has no column {TIME!r} of times", place=str(path))
    columns = [name for name in names if name not in (TIME, FRAME)]
    return ValueRows([column_of(name) for name in columns], _rows(file, columns))


def _rows(file: Any, columns: list[str]) -> Iterator[tuple[float, list[float | None]]]:
    for batch in file.iter_batches(columns=[TIME, *columns]):
        cells = [batch.column(name).to_pylist() for name in columns]
        for number, time in enumerate(batch.column(TIME).to_pylist()):
            yield time.timestamp(), [_number(values[number]) for values in cells]


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
