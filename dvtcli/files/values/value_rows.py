"""What every form of a file of values has: a writer of frames, and columns with rows. Knows no form."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import IO, Protocol

from dvtcli.domain.ports import Frame
from dvtcli.watch.table import Column

#: the suffix of what stands for a .parquet file until that is whole
STREAM = ".arrows"


#: the layouts of a .parquet file, the default first: a row for each value, a column for each signal
LONG, WIDE = "long", "wide"


@dataclass(frozen=True, slots=True)
class Origin:
    """Where values are from: *source* is who recorded them, *serials* are the serial numbers of nodes by node-ID.

    *facts* are for the file's metadata, by their keys.
    """

    source: str = ""
    serials: Mapping[int, int] = field(default_factory=dict)
    facts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ParquetForm:
    """How a .parquet file is written: in *layout*, and if it is *live* so that a power-off takes one second at most."""

    layout: str = LONG
    origin: Origin = Origin()
    live: bool = False


class ValueWriter(Protocol):
    """A file of values that frames are written to."""

    @property
    def size(self) -> int:
        """How many bytes were written."""
        ...

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write one frame, which was on *bus*, where it has any of the signals."""
        ...

    def flush(self) -> None:
        """Hand what was written to the system, as far as the form can."""
        ...

    def close(self) -> None:
        """Write the end, so that the file can be read."""
        ...


def size_of_open(file: IO[str]) -> int:
    """How many bytes were handed to the system."""
    return os.fstat(file.fileno()).st_size


@dataclass(frozen=True, slots=True)
class ValueRows:
    """A file's *columns* in order, and its rows: a time (s) and a number a column, None where there is none."""

    columns: list[Column]
    rows: Iterator[tuple[float, list[float | None]]]
