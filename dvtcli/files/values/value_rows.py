"""The common interface of value files: a writer of frames, and columns with rows."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Protocol

from dvtcli.domain.ports import Frame
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
