"""What every file of values shares: columns with rows, and a name that it gets when it is complete."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Protocol

from dvtcli.device.change.lock import lock_within
from dvtcli.device.change.private_file import put_in_place, remove, sync_folder, to_disk
from dvtcli.domain.ports import Frame
from dvtcli.errors import SafetyRefusal
from dvtcli.watch.table import Column

#: the suffix of the Arrow stream kept until a .parquet file is complete
STREAM = ".arrows"
#: the layouts of a .parquet file, the default first: a row for each value, a column for each signal
LONG, WIDE = "long", "wide"


@dataclass(frozen=True, slots=True)
class Origin:
    """The origin of values: *source* is the recorder, *serials* are serial numbers of nodes by node-ID.

    *facts* are further metadata for the file, by key.
    """

    source: str = ""
    serials: Mapping[int, int] = field(default_factory=dict)
    facts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ParquetForm:
    """The form of a .parquet file: its *layout*, and where its values come from."""

    layout: str = LONG
    origin: Origin = Origin()


class ValueWriter(Protocol):
    """A file of values to which frames are written."""

    @property
    def size(self) -> int:
        """How many bytes were written."""
        ...

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write a frame from *bus*, if any signal is in the frame."""
        ...

    def flush(self) -> None:
        """Hand what was written to the system, as far as the form can."""
        ...

    def close(self) -> None:
        """Complete the file, so that it can be read. Raises OSError; the file is closed even so."""
        ...


def stream_of(path: Path) -> Path:
    """Return the path of the Arrow stream with the values of the unfinished .parquet file *path*."""
    return path.with_name(f"_{path.stem}{STREAM}")


def size_of_open(file: IO[str]) -> int:
    """How many bytes were handed to the system."""
    return os.fstat(file.fileno()).st_size


@dataclass(frozen=True, slots=True)
class ValueRows:
    """A file's *columns* in order, and its rows: a time (s), and a number or None per column."""

    columns: list[Column]
    rows: Iterator[tuple[float, list[float | None]]]


class PartFile:
    """A new, empty *file* that `complete` names *path*; an old file of that name stays until then.

    A link at *path* stays, and its target is replaced; a pipe is written directly. Raises SafetyRefusal if another
    process is writing it, OSError.
    """

    def __init__(self, path: Path) -> None:
        self._path = Path(os.path.realpath(path))
        self._part = part_of(self._path)
        self._is_pipe = self._path.exists() and not self._path.is_file()
        if self._is_pipe:
            self.file: IO[bytes] = self._path.open("wb")
            return
        self.file = open_locked(self._part)
        self.file.truncate(0)
        self.file.seek(0)

    def complete(self, name: str = "") -> int:
        """Put the file on the disk under *name* (empty: that of *path*); returns its size in bytes. Raises OSError."""
        self.file.flush()
        if self._is_pipe:
            self.file.close()
            return 0
        to_disk(self.file.fileno())
        size = os.fstat(self.file.fileno()).st_size
        if sys.platform == "win32":  # renames no open file
            self.file.close()
        put_in_place(self._part, self._path.with_name(name) if name else self._path)
        self.file.close()
        sync_folder(self._path.parent)
        return size

    def discard(self) -> None:
        """Remove the file."""
        if self._is_pipe:
            self.file.close()
        else:
            remove_locked(self.file, self._part)


def part_of(path: Path) -> Path:
    """Return the name of the unfinished file *path*."""
    return path.with_name(f"_{path.name}.part")


def open_locked(path: Path, mode: str = "ab+") -> IO[bytes]:
    """Open *path* in *mode* and lock it until it is closed. Raises SafetyRefusal if another process has it, OSError."""
    while True:
        file: IO[bytes] = path.open(mode)
        try:
            lock_within(file, 0.0)
        except OSError as taken:
            file.close()
            raise SafetyRefusal(f"another dvtcli is writing {path}", hint="take another file") from taken
        if _has_name(file, path):
            return file
        file.close()  # its last holder renamed or removed it meanwhile


def _has_name(file: IO[bytes], path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def remove_locked(file: IO[bytes], path: Path) -> None:
    """Remove *path*, which is open and locked as *file*, before another process can lock it."""
    if sys.platform == "win32":  # removes no open file: neither ours nor that of who opens it now
        file.close()
    remove(path)
    with suppress(OSError):  # what a full disk did not take: nobody wants it any more
        file.close()
