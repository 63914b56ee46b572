"""What every form of a file of values has: a writer of frames, and columns with rows. Knows no form."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO, Protocol

from dvtcli.domain.ports import Frame
from dvtcli.watch.table import Column

#: the suffix of what stands for a .parquet file until that is whole
STREAM = ".arrows"


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
