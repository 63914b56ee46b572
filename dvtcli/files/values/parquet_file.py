"""Write Parquet, and recover what a killed recording left.

Parquet has its table of contents at the end, so that a file is of no use before it is complete. Live values also go to
`_run.arrows`, an Arrow stream that is on the disk up to its last batch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from time import monotonic
from typing import IO, Any, Protocol

from dvtcli.device.change.private_file import remove, set_aside, sync_folder, to_disk
from dvtcli.domain.ports import Frame
from dvtcli.errors import SafetyRefusal
from dvtcli.files.values.parquet_values import ROWS, pyarrow
from dvtcli.files.values.value_rows import PartFile, open_locked, part_of, remove_locked, stream_of

#: maximum time until a value is on the disk (s)
_AT_MOST_S = 1.0
#: batches that are kept back for a row group
_MOST_BATCHES = 64
#: what an Arrow message begins with
_MESSAGE = b"\xff" * 4
#: the multiple of bytes at which a message begins, and how many are searched at once
_ALIGNED, _BLOCK = 8, 1 << 20


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


class ParquetFile:
    """Batches of *schema* as Parquet in the open *file*, in row groups of at least *group* rows."""

    def __init__(self, file: IO[bytes], schema: Any, group: int) -> None:
        self._file, self._group = file, group
        self._parquet = pyarrow("pyarrow.parquet").ParquetWriter(file, schema)
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

    def close(self) -> None:
        """Write pending rows and the table of contents; *file* stays open."""
        self._write_group()
        self._parquet.close()


class ParquetWriter:
    """Writes *table* as Parquet to the open *file*, and each batch to *stream*, too: a second after its first row."""

    def __init__(self, file: IO[bytes], table: Table, stream: ArrowStream | None = None) -> None:
        self._table, self._stream = table, stream
        self._parquet = ParquetFile(file, table.schema, table.group)
        self._since_s: float | None = None
        self.size = 0

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write a frame from *bus*."""
        self._table.add(frame, bus)
        if len(self._table) >= self._table.batch_rows:
            self._write_batch()

    def flush(self) -> None:
        """Put on the disk what waits for longer than a second; nothing without a stream."""
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
        try:
            if self._stream is not None:
                self._stream.write(batch)
        finally:  # if the stream fails, the file may still be completed
            self._parquet.write(batch)
            self.size = self._parquet.size

    def close(self) -> None:
        """Write pending rows and the table of contents."""
        self._write_batch()
        self._parquet.close()


class LiveParquet:
    """Writes *table* to a new file at *path*, complete when closed; a power-off loses at most the last second.

    Raises SafetyRefusal if another process is writing it, or a killed one has left its values, OSError.
    """

    def __init__(self, path: Path, table: Table) -> None:
        self._stream = ArrowStream(stream_of(path), table.schema)
        try:
            self._part = PartFile(path)
        except BaseException:
            self._stream.remove()
            raise
        remove(path)  # from now on a file of that name is this recording
        self._writer = ParquetWriter(self._part.file, table, self._stream)
        self._size = 0

    @property
    def size(self) -> int:
        """The number of bytes written or pending."""
        return self._size or self._writer.size

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write a frame from *bus*."""
        self._writer.write(frame, bus)

    def flush(self) -> None:
        """Put on the disk what waits for longer than a second."""
        self._writer.flush()

    def close(self) -> None:
        """Complete the file. Raises OSError: then its values stay in the stream, for `finish`."""
        try:
            self._writer.close()
            self._size = self._part.complete()
        except OSError:
            self._part.discard()
            self._stream.close()
            raise
        self._stream.remove()


class ArrowStream:
    """A new Arrow stream at *path*, locked; its batches are on the disk when they were written."""

    def __init__(self, path: Path, schema: Any) -> None:
        arrow = pyarrow()
        self._path = path
        self._file = open_locked(path)
        if self._file.tell():
            self._file.close()
            raise SafetyRefusal(
                f"{path} has values of a recording that was killed", hint="begin again: it is completed"
            )
        options = arrow.ipc.IpcWriteOptions(compression="zstd" if arrow.Codec.is_available("zstd") else None)
        self._is_torn = False
        try:
            self._stream = arrow.ipc.new_stream(self._file, schema, options=options)
            self._to_disk()
            sync_folder(path.parent)
        except OSError:
            self.remove()
            raise

    def _to_disk(self) -> None:
        self._file.flush()
        to_disk(self._file.fileno())

    def write(self, batch: Any) -> None:
        """Write *batch*; nothing after a batch that the disk did not take. Raises OSError."""
        if self._is_torn:
            return
        self._is_torn = True
        self._stream.write_batch(batch)
        self._to_disk()
        self._is_torn = False

    def close(self) -> None:
        """Close the stream; its file stays."""
        self._file.close()

    def remove(self) -> None:
        """Remove the stream."""
        remove_locked(self._file, self._path)


@dataclass(frozen=True, slots=True)
class Finished:
    """A killed recording of which *rows* are in the .parquet file *path* now.

    *aside* is the file with all that its process left, if a part of it is damaged; None otherwise.
    """

    path: Path
    rows: int
    aside: Path | None


def finish(stream: Path, path: Path, other: Callable[[], Path]) -> Finished | None:
    """Make the .parquet file *path* from the Arrow *stream* of a killed `log`, and remove *stream*.

    A last batch that was torn is left out. If *path* has another recording by now, the file gets the name *other*().
    Returns None if *stream* is still being written. Raises OSError: then *stream* stays.
    """
    try:
        file = open_locked(stream, "rb")
    except SafetyRefusal:
        return None
    with file:
        batches, rows, named = _Batches(file), 0, path
        if path.exists() and not _has_rows(path, batches):
            named = other()
        if not named.exists():  # else it is this recording: killed before its stream was removed
            rows = _write(named, batches)
        _remove_part(path)
        if not batches.is_damaged:
            remove_locked(file, stream)
            return Finished(named, rows, None)
    return Finished(named, rows, set_aside(stream, "damaged"))


def _has_rows(path: Path, batches: Iterable[Any]) -> bool:
    """Whether the .parquet file *path* has the rows of *batches*, and no others."""
    try:
        file = pyarrow("pyarrow.parquet").ParquetFile(str(path))
        return all(one == other for one, other in zip_longest(_batch_rows(file.iter_batches()), _batch_rows(batches)))
    except (pyarrow().ArrowException, OSError, ValueError):  # it is another file
        return False


def _batch_rows(batches: Iterable[Any]) -> Iterator[str]:
    for batch in batches:
        yield from map(str, batch.to_pylist())


def _write(path: Path, batches: Iterable[Any]) -> int:
    """Write *batches* to a new file *path*, if there are any; returns the number of rows."""
    rows = 0
    for batch in batches:
        if not rows:
            part = PartFile(path)
            parquet = ParquetFile(part.file, batch.schema, ROWS)
        rows += len(batch)
        try:
            parquet.write(batch)
        except OSError:
            part.discard()
            raise
    if rows:
        try:
            parquet.close()
            part.complete()
        except OSError:
            part.discard()
            raise
    return rows


def _remove_part(path: Path) -> None:
    """Remove the unfinished Parquet file of *path*, unless another process is writing it."""
    part = part_of(path)
    if part.exists():
        with suppress(SafetyRefusal):
            remove_locked(open_locked(part), part)


class _Batches:
    """The batches of the Arrow stream in *file* up to the first that is torn or damaged.

    *is_damaged* after them: there is more behind them than one batch that was torn by a kill or a power-off.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.is_damaged = False

    def __iter__(self) -> Iterator[Any]:
        arrow, end = pyarrow(), 0
        self._file.seek(0)
        try:
            reader = arrow.ipc.open_stream(self._file)
            while True:
                end = self._file.tell()
                batch = reader.read_next_batch()
                batch.validate(full=True)
                yield batch
        except StopIteration:
            pass
        except (arrow.ArrowException, OSError) as wrong:
            if isinstance(wrong, OSError) and wrong.errno:  # of the disk, not of what is on it
                raise
        except MemoryError:  # a length in it is damaged, or memory is short
            self.is_damaged = True
            return
        self.is_damaged = not self._is_torn(end)

    def _is_torn(self, end: int) -> bool:
        """Whether a part of one message stands behind *end*, or nothing but zeros."""
        self._file.seek(end)
        head = self._file.read(len(_MESSAGE))
        if not _MESSAGE.startswith(head):
            return not any(head) and all(not block.strip(b"\0") for block in self._blocks(end))
        return not any(
            self._is_message(end + number * _BLOCK + at)
            for number, block in enumerate(self._blocks(end))
            for at in range(0, len(block), _ALIGNED)
            if block.startswith(_MESSAGE, at) and number + at
        )

    def _blocks(self, begin: int) -> Iterator[bytes]:
        while True:
            self._file.seek(begin)
            if not (block := self._file.read(_BLOCK)):
                return
            yield block
            begin += len(block)

    def _is_message(self, at: int) -> bool:
        """Whether a whole message with a batch stands at *at*."""
        arrow = pyarrow()
        self._file.seek(at)
        try:
            return bool(arrow.ipc.read_message(self._file).type == "record batch")
        except (arrow.ArrowException, OSError, EOFError):
            return False
