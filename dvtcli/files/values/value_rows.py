"""What every form of a file of values has: a writer of frames, and columns with rows. Knows no form."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from dvtcli.domain.ports import Frame
from dvtcli.watch.table import Column


class ValueWriter(Protocol):
    """A file of values that frames are written to."""

    def write(self, frame: Frame) -> None:
        """Write one frame, where it has any of the signals."""
        ...

    def flush(self) -> None:
        """Hand what was written to the system, as far as the form can."""
        ...

    def close(self) -> None:
        """Write the end, so that the file can be read."""
        ...


@dataclass(frozen=True, slots=True)
class ValueRows:
    """A file's *columns* in order, and its rows: a time (s) and a number a column, None where there is none."""

    columns: list[Column]
    rows: Iterator[tuple[float, list[float | None]]]
