"""Write a Parquet file: it gets its name when complete, and can be recovered after a power-off.

Parquet has its table of contents at the end. Until then the file is named `_run.parquet.part`, which readers of a
folder ignore. Live values also go to `_run.arrows`, an Arrow stream that is on the disk up to its last batch.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any, Protocol

from dvtcli.device.change.lock import lock_within
from dvtcli.device.change.private_file import put_in_place, remove, sync_folder, to_disk
from dvtcli.domain.ports import Frame
from dvtcli.errors import SafetyRefusal
from dvtcli.files.values.parquet_values import ROWS, pyarrow
from dvtcli.files.values.value_rows import STREAM

#: maximum time until a value is on the disk (s)
_AT_MOST_S = 1.0
#: batches that are kept back for a row group
_MOST_BATCHES = 64


class Table(Protocol):
    """Rows in one layout, as pyarrow has them; *batch_rows* make a batch, *group* a row group."""

    schema: Any
    batch_rows: int
    group: int

    def __len__(self) -> int:
        """The number of rows since the last batch."""
        ...

    def add(self, frame: Frame, bus: str) -> None:
        """Add the values of *frame* from *bus*."""
        ...

    def batch(self) -> Any:
        """Return the rows added since the last batch."""
        ...


class _WholeParquet:
    """The file at *path*, in row groups of at least *group* rows, under another name until closed."""

    def __init__(self, path: Path, schema: Any, group: int) -> None:
        self._path, self._group = path, group
        self._part = part_of(path)
        self._file = self._part.open("wb")
        self._parquet = pyarrow("pyarrow.parquet").ParquetWriter(self._file, schema)
        self._kept: list[Any] = []
        self._rows = self._bytes = 0

    @property
    def size(self) -> int:
        """The number of bytes written or pending."""
        return self._file.tell() + self._bytes

    def write(self, batch: Any) -> None:
        """Add *batch*, and write all pending rows if they fill a row group."""
        self._kept.append(batch)
        self._rows += len(batch)
        self._bytes += batch.nbytes
        if self._rows >= self._group:
            self._write_group()
        elif len(self._kept) >= _MOST_BATCHES:  # each takes some kilobytes, however few rows it has
            self._kept = pyarrow().Table.from_batches(self._kept).combine_chunks().to_batches()

    def _write_group(self) -> None:
        if self._kept:
            self._parquet.write_table(pyarrow().Table.from_batches(self._kept))
            self._kept, self._rows, self._bytes = [], 0, 0

    def close(self) -> int:
        """Write pending rows and the end, and give the file its name; returns its size in bytes."""
        with self._file:
            self._write_group()
            self._parquet.close()
            self._file.flush()
            to_disk(self._file.fileno())
            size = self._file.tell()
        put_in_place(self._part, self._path)
        sync_folder(self._path.parent)
        return size


class ParquetWriter:
    """Writes *table* to a new file at *path*; *live*: a power-off loses at most the last second."""

    def __init__(self, path: Path, table: Table, *, live: bool = False) -> None:
        self._table = table
        self._stream = None
        if live:
            self._stream = _Stream(stream_of(path), table.schema)
            remove(path)  # a file of that name is this recording, whole
        self._parquet = _WholeParquet(path, table.schema, table.group)
        self._since_s: float | None = None
        self.size = 0

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write a frame from *bus*."""
        self._table.add(frame, bus)
        if len(self._table) >= self._table.batch_rows:
            self._write_batch()

    def flush(self) -> None:
        """Put on the disk what waits for longer than a second; nothing if the file is not live."""
        if self._stream is None or not len(self._table):
            return
        if self._since_s is None:
            self._since_s = monotonic()
        elif monotonic() - self._since_s >= _AT_MOST_S:
            self._write_batch()

    def _write_batch(self) -> None:
        self._since_s = None
        if not len(self._table):
            return
        batch = self._table.batch()
        if self._stream is not None:
            self._stream.write(batch)
        self._parquet.write(batch)
        self.size = self._parquet.size

    def close(self) -> None:
        """Write pending rows and the end."""
        self._write_batch()
        self.size = self._parquet.close()
        if self._stream is not None:
            self._stream.remove()


class _Stream:
    """An Arrow stream at *path* whose batches are on the disk when they were written."""

    def __init__(self, path: Path, schema: Any) -> None:
        arrow = pyarrow()
        self._path = path
        self._file = path.open("ab")
        try:
            lock_within(self._file, 0.0)
        except OSError as taken:
            raise SafetyRefusal(f"another dvtcli is writing {path}", hint="log into another file") from taken
        self._file.truncate(0)
        options = arrow.ipc.IpcWriteOptions(compression="zstd" if arrow.Codec.is_available("zstd") else None)
        self._stream = arrow.ipc.new_stream(self._file, schema, options=options)
        self._to_disk()
        sync_folder(path.parent)

    def _to_disk(self) -> None:
        self._file.flush()
        to_disk(self._file.fileno())

    def write(self, batch: Any) -> None:
        """Write *batch*."""
        self._stream.write_batch(batch)
        self._to_disk()

    def remove(self) -> None:
        """Take the stream away."""
        self._stream.close()
        self._file.close()
        remove(self._path)


def part_of(path: Path) -> Path:
    """Return the name of the unfinished .parquet file *path*."""
    return path.with_name(f"_{path.name}.part")


def stream_of(path: Path) -> Path:
    """Return the path of the Arrow stream with the values of the unfinished .parquet file *path*."""
    return path.with_name(f"_{path.stem}{STREAM}")


def has_rows_of(path: Path, stream: Path) -> bool:
    """Tell whether the .parquet file *path* is the recording in the Arrow *stream*, by their numbers of rows."""
    with stream.open("rb") as file:
        count = sum(map(len, _whole_batches(file)))
    with suppress(pyarrow().ArrowException, OSError):
        return count in (0, pyarrow("pyarrow.parquet").read_metadata(path).num_rows)
    return False


def finish(stream: Path, path: Path) -> int | None:
    """Make the .parquet file *path* from the Arrow *stream* of a killed `log`; returns the number of rows.

    A torn end is left out. Returns None if *stream* has no rows, or is still being written. Raises OSError.
    """
    rows = 0
    with stream.open("rb") as file:
        try:
            lock_within(file, 0.0)
        except OSError:
            return None
        file.seek(0)
        for batch in () if path.exists() else _whole_batches(file):
            if not rows:
                whole = _WholeParquet(path, batch.schema, ROWS)
            rows += len(batch)
            whole.write(batch)
        if rows:
            whole.close()
    remove(part_of(path))
    remove(stream)
    return rows or None


def _whole_batches(file: Any) -> Iterator[Any]:
    """Iterate over the batches of the Arrow stream in *file* up to the first torn batch."""
    arrow = pyarrow()
    with suppress(StopIteration, arrow.ArrowException, OSError):
        reader = arrow.ipc.open_stream(file)
        while True:
            yield reader.read_next_batch()
