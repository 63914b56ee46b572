"""Values as Apache Parquet by pyarrow, an optional extra: a row per value, or a column per signal.

The long layout has the same schema for all devices and files, so that a fleet's files form one table; the wide layout
is a table of one recording. Texts are kept as in the device and its file.
"""

from __future__ import annotations

import math
import sys
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from datetime import datetime
from decimal import Decimal
from itertools import accumulate, chain
from pathlib import Path
from typing import Any

from dvtcli.domain.datatypes import Kind, Value
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.scaling import Scaling
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.extras import extra
from dvtcli.files.values.text_values import FRAME, TIME, column_of
from dvtcli.files.values.value_rows import Origin, ValueRows
from dvtcli.watch.decoder import Signal
from dvtcli.watch.service import Service
from dvtcli.watch.table import Column, SignalRows, signal_name

#: the long layout's columns, with pyarrow's names of their types
_LONG = {
    TIME: "timestamp", "source": "string", "bus": "string", "node": "int32", "serial": "int64", "pdo": "string",
    "object": "string", "name": "string", "unit": "string", "value": "float64", "raw": "int64", "text": "string",
}  # fmt: skip
#: columns of the long layout with equal values in all rows of a signal
_OF_SIGNAL = ("node", "serial", "pdo", "object", "name", "unit")
_INT64 = range(-(1 << 63), 1 << 63)
#: rows of a batch and of a row group; in the wide layout, which has a column for each signal, both are the same
BATCH, ROWS, _WIDE_ROWS = 8_192, 65_536, 8_192
#: the most signals of the wide layout: each takes 0.4 MB if a recording has 1,000,000 frames
MOST_COLUMNS = 144
#: how Python's arrays call the types of cells
_CODES = {"int32": "i", "int64": "q", "double": "d", "timestamp[us, tz=UTC]": "q"}


def pyarrow(module: str = "pyarrow") -> Any:
    """Import pyarrow, or its *module*. Raises UsageError if missing."""
    return extra(module, "parquet", "a .parquet file")


class LongTable:
    """Rows of the long layout, one for each value of a frame known to *rows*, or for the words of a frame."""

    batch_rows, group = BATCH, ROWS

    def __init__(self, rows: SignalRows, origin: Origin) -> None:
        self._arrow = arrow = pyarrow()
        self._rows, self._source = rows, origin.source
        self.schema = _schema(arrow, _LONG, origin)
        self._signals = [column.signal for column in rows.columns]
        self._origin = origin
        #: the constant columns of each signal, then of services in words
        self._told = [_told(signal, of, origin) for signal, of in zip(self._signals, rows.services, strict=True)]
        self._words: dict[tuple[Service, str, str], int] = {}
        self._clear()

    def _clear(self) -> None:
        self._times: list[int] = []
        self._buses: list[str | None] = []
        self._numbers: list[int] = []
        self._values: list[tuple[float | None, int | None, str | None]] = []

    def __len__(self) -> int:
        return len(self._numbers)

    def add(self, frame: Frame, bus: str) -> None:
        """Add the values of *frame* from *bus*."""
        time_us = round(frame.timestamp_s * 1_000_000)
        values = self._rows.values(frame)
        for number, value in values or ():
            self._times.append(time_us)
            self._buses.append(bus or None)
            self._numbers.append(number)
            self._values.append(long_cells(self._signals[number], value))
        if values is not None and self._rows.reading.text:
            self._times.append(time_us)
            self._buses.append(bus or None)
            self._numbers.append(self._in_words(self._rows.layout(frame).service))
            self._values.append((None, None, text_cell(self._rows.reading.text)))

    def _in_words(self, service: Service) -> int:
        """Return the number of the constant columns of the last frame, which is in words."""
        reading = self._rows.reading
        place = str(reading.facts.get("object") or "")
        key = service, reading.what, place
        if key not in self._words:
            self._words[key] = len(self._told)
            self._told.append(_told(Signal(reading.what, reading.what, place), service, self._origin))
        return self._words[key]

    def batch(self) -> Any:
        """Return the rows added since the last batch."""
        arrow = self._arrow
        numbers = cells_array(arrow, arrow.int32(), self._numbers)
        columns: dict[str, Any] = {
            name: cells_array(arrow, self.schema.field(name).type, [told[name] for told in self._told]).take(numbers)
            for name in _OF_SIGNAL
        }
        cells: dict[str, Sequence[Any]] = {
            TIME: self._times,
            "bus": self._buses,
            "source": [self._source or None] * len(self),
        }
        cells |= {name: [row[place] for row in self._values] for place, name in enumerate(("value", "raw", "text"))}
        columns |= {name: cells_array(arrow, self.schema.field(name).type, column) for name, column in cells.items()}
        self._clear()
        return arrow.RecordBatch.from_arrays([columns[name] for name in self.schema.names], schema=self.schema)


def _told(signal: Signal, service: Service, origin: Origin) -> dict[str, Any]:
    """Return the constant columns of *signal* in the long layout."""
    node, pdo = service.node, service.label.lower() if service.kind == "pdo" else service.label
    serial = None if node is None else origin.serials.get(node)
    return {
        "node": node, "serial": serial, "pdo": text_cell(pdo), "object": signal.object or None,
        "name": text_cell(signal.key), "unit": text_cell(signal.unit) or None,
    }  # fmt: skip


def long_cells(signal: Signal, raw: Value) -> tuple[float | None, int | None, str | None]:
    """Return value in the signal's unit, raw whole number, and text of *raw*.

    A number beyond 64 bits with sign becomes a text of digits. Values of a DBC file have no raw value.
    """
    if not isinstance(raw, int | float):
        return None, None, text_cell(raw)
    meaning = signal.meaning
    value = float(meaning.number(raw)) if meaning.has_number else float(raw)
    if isinstance(raw, float) or not signal.object:
        return value, None, None
    if raw not in _INT64:
        return value, None, str(raw)
    return value, int(raw), text_cell(meaning.word(raw)) or None


def text_cell(value: Value) -> str:
    """Return a non-number as a cell: bytes in hex, texts without lone surrogates (not valid in UTF-8)."""
    text = value.hex(" ").upper() if isinstance(value, bytes) else str(value)
    return text.encode("utf-8", "replace").decode()


class WideTable:
    """Rows of the wide layout, one for each frame known to *rows*, with a column per signal.

    A column's type depends on the signal, not on its values: a number with a unit is a double, any other whole number
    is signed, so that differences are right. An unsigned 64-bit number is a decimal.
    """

    batch_rows = group = _WIDE_ROWS

    def __init__(self, rows: SignalRows, origin: Origin) -> None:
        if len(rows.columns) > MOST_COLUMNS:
            raise UsageError(
                f"the wide layout takes {MOST_COLUMNS} signals, and there are {len(rows.columns)}",
                hint=Hint(Action.GIVE, {"filter": "TEXT"}, "{} chooses some; the long layout takes all"),
            )
        self._arrow = arrow = pyarrow()
        self._rows = rows
        self._kinds = [_kind(column) for column in rows.columns]
        heads = [text_cell(column.header) for column in rows.columns]
        about = {head: _about(column.signal) for head, column in zip(heads, rows.columns, strict=True)}
        kinds = {TIME: "timestamp", FRAME: "string", **dict(zip(heads, self._kinds, strict=True))}
        self.schema = _schema(arrow, kinds, origin, about)
        self._clear()

    def _clear(self) -> None:
        self._times: list[int] = []
        self._titles: list[str] = []
        #: of each column the rows that have a cell, and these
        self._places = [array("i") for _ in self._kinds]
        self._cells: list[list[object]] = [[] for _ in self._kinds]

    def __len__(self) -> int:
        return len(self._times)

    def add(self, frame: Frame, _bus: str) -> None:
        """Add the values of *frame*."""
        values = self._rows.values(frame)
        if values is None:
            return
        at = len(self._times)
        for number, value in values:
            cell = self._rows.columns[number].cell(value)
            self._places[number].append(at)
            self._cells[number].append(_cell(cell, self._kinds[number]))
        self._times.append(round(frame.timestamp_s * 1_000_000))
        self._titles.append(text_cell(self._rows.head(frame)))

    def batch(self) -> Any:
        """Return the rows added since the last batch."""
        kinds = (each.type for each in self.schema)
        columns: Iterable[Sequence[Any]] = chain(
            (self._times, self._titles), map(self._column, self._places, self._cells)
        )
        arrays = [cells_array(self._arrow, kind, column) for kind, column in zip(kinds, columns, strict=True)]
        self._clear()
        return self._arrow.RecordBatch.from_arrays(arrays, schema=self.schema)

    def _column(self, places: Iterable[int], cells: Iterable[object]) -> list[object]:
        column: list[object] = [None] * len(self)
        for at, cell in zip(places, cells, strict=True):
            column[at] = cell
        return column


def cells_array(arrow: Any, kind: Any, cells: Sequence[Any]) -> Any:
    """Return *cells* (None: null) as an array of pyarrow's *kind*.

    `pyarrow.array` would import pandas for a list, if installed: 50 MB, and a second.
    """
    valid = _bits(arrow, [cell is not None for cell in cells]) if None in cells else None
    if kind == arrow.string():
        data = [b"" if cell is None else cell.encode() for cell in cells]
        ends = array("i", accumulate(map(len, data), initial=0))
        buffers = [arrow.py_buffer(ends), arrow.py_buffer(b"".join(data))]
    elif kind == arrow.bool_():
        buffers = [_bits(arrow, cells)]
    elif arrow.types.is_decimal(kind):
        buffers = [arrow.py_buffer(b"".join((cell or 0).to_bytes(16, sys.byteorder, signed=True) for cell in cells))]
    else:
        buffers = [arrow.py_buffer(array(_CODES[str(kind)], [0 if cell is None else cell for cell in cells]))]
    return arrow.Array.from_buffers(kind, len(cells), [valid, *buffers])


def _bits(arrow: Any, cells: Iterable[object]) -> Any:
    """Return a buffer with a bit for each of *cells*, set if true."""
    each = bytes(map(bool, cells))
    return (
        arrow.Array.from_buffers(arrow.uint8(), len(each), [None, arrow.py_buffer(each)])
        .cast(arrow.bool_())
        .buffers()[1]
    )


def _schema(arrow: Any, kinds: Mapping[str, str], origin: Origin, about: Mapping[str, Any] | None = None) -> Any:
    types = {"timestamp": arrow.timestamp("us", tz="UTC"), "decimal": arrow.decimal128(20, 0)}
    fields = [
        arrow.field(name, types.get(kind) or getattr(arrow, kind)(), metadata=(about or {}).get(name))
        for name, kind in kinds.items()
    ]
    return arrow.schema(fields, {key: text_cell(value) for key, value in origin.facts.items()})


def _about(signal: Signal) -> dict[str, str]:
    about = {"unit": text_cell(signal.unit), "object": signal.object}
    return {key: said for key, said in about.items() if said}


def _kind(column: Column) -> str:
    """Return pyarrow's name for the type of a column in the wide layout."""
    signal, kind = column.signal, column.signal.data_type and column.signal.data_type.kind
    if signal.meaning.has_number or not signal.object or kind is Kind.REAL:
        return "float64"  # also of a DBC file, whose values are scaled already
    if kind is Kind.BOOLEAN:
        return "bool_"
    if kind is Kind.INTEGER:
        return "int64"
    if kind is Kind.UNSIGNED or (kind is None and 0 < signal.bits <= 64):
        return "int64" if signal.bits < 64 else "decimal"
    return "string"


def _cell(value: Value, kind: str) -> object:
    if kind == "float64":
        return float(value) if isinstance(value, int | float) else None
    if kind == "decimal":
        return value if isinstance(value, int) else None
    return text_cell(value) if kind == "string" else value


def read_parquet(path: Path) -> ValueRows:
    """Read output of `log` or `decode` in either layout. Raises InputFileError, also in its rows, if damaged."""
    arrow = pyarrow()
    if not path.is_file():
        raise UsageError(f"{path}: no such file", hint=Hint(Action.LOG_VALUES, {"file": path}, "records one"))
    try:
        file = pyarrow("pyarrow.parquet").ParquetFile(str(path))
        schema, names = file.schema_arrow, file.schema_arrow.names
    except (arrow.ArrowException, OSError, ValueError) as wrong:
        raise InputFileError(f"{path.name} is not a complete Parquet file", why=_why(wrong), place=str(path)) from wrong
    if nested := [name for name in names if arrow.types.is_nested(schema.field(name).type)]:
        raise InputFileError(f"{path.name}: column {nested[0]!r} has no plain values", place=str(path))
    if TIME not in names or not arrow.types.is_timestamp(schema.field(TIME).type):
        raise InputFileError(f"{path.name} has no column {TIME!r} of times", place=str(path))
    if {"pdo", *_OF_SIGNAL, "value"} <= {*names}:
        return _read_long(path, file)
    columns = [name for name in names if name not in (TIME, FRAME)]
    return ValueRows([column_of(name) for name in columns], _wide_rows(path, file, columns))


def _cells(path: Path, file: Any, names: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    """Iterate over the rows of *file*, cells of columns *names*. Raises InputFileError with the row if damaged."""
    row = 0
    try:
        for batch in file.iter_batches(columns=list(names)):
            batch.validate(full=True)
            for cells in zip(*(batch.column(name).to_pylist() for name in names), strict=True):
                yield cells
                row += 1
    except (pyarrow().ArrowException, OSError, ValueError, OverflowError) as wrong:
        raise InputFileError(f"{path.name} is damaged after row {row}", why=_why(wrong), place=str(path)) from wrong


def _why(wrong: Exception) -> str:
    return str(wrong).partition("\n")[0] or type(wrong).__name__


def _time_s(path: Path, time: datetime | None) -> float:
    if time is None:
        raise InputFileError(f"{path.name} has a row without a time", place=str(path))
    return time.timestamp()


def _wide_rows(path: Path, file: Any, columns: list[str]) -> Iterator[tuple[float, list[float | None]]]:
    for time, *cells in _cells(path, file, [TIME, *columns]):
        yield _time_s(path, time), [_number(cell) for cell in cells]


def _read_long(path: Path, file: Any) -> ValueRows:
    """Read a file in the long layout, twice: first for its signals."""
    numbers: dict[tuple[object, ...], int] = {}
    columns: list[Column] = []
    for signal in _cells(path, file, ("bus", *_OF_SIGNAL)):
        if signal not in numbers:
            numbers[signal] = len(numbers)
            columns.append(_long_column(*signal))
    return ValueRows(columns, _frames(path, file, numbers))


def _long_column(_bus: object, node: Any, _serial: object, pdo: Any, place: Any, name: Any, unit: Any) -> Column:
    title = f"{str(pdo).upper()} node {node}" if node else str(pdo or "")
    key = str(name or place or "")
    signal = Signal(key, key, str(place or ""), Scaling(str(unit or "")))
    return Column(signal_name(title, signal.object, key), signal)


def _frames(
    path: Path, file: Any, numbers: Mapping[tuple[object, ...], int]
) -> Iterator[tuple[float, list[float | None]]]:
    """A row for each frame: what follows each other with the same time, bus, node and PDO."""
    last: object = None
    time_s, cells = 0.0, _no_cells(numbers)
    for time, value, *signal in _cells(path, file, (TIME, "value", "bus", *_OF_SIGNAL)):
        number = numbers[tuple(signal)]
        frame = (time, *signal[:4])
        if frame != last or cells[number] is not None:
            if last is not None:
                yield time_s, cells
            last, time_s, cells = frame, _time_s(path, time), _no_cells(numbers)
        cells[number] = _number(value)
    if last is not None:
        yield time_s, cells


def _no_cells(numbers: Sized) -> list[float | None]:
    return [None] * len(numbers)


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float | Decimal) and math.isfinite(value) else None
