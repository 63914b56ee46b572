"""Write values into a series of files: `run.parquet`, `run-0002.parquet`, …, each complete before the next.

First completes the files of a killed `log`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from dvtcli.domain.ports import Frame
from dvtcli.files.values.value_rows import STREAM, ValueWriter


@dataclass(frozen=True, slots=True)
class Rotation:
    """The limit of a file: *seconds* or *size_bytes*; 0 for no limit."""

    seconds: float = 0.0
    size_bytes: int = 0


class ValueParts:
    """Writes frames into files opened by *opened*, the first at *path*, the next by *rotation*."""

    def __init__(self, path: Path, opened: Callable[[Path], ValueWriter], rotation: Rotation) -> None:
        self._path, self._opened, self._rotation = path, opened, rotation
        #: the files in order, and the bytes of closed files
        self.files: list[Path] = []
        self.size = 0
        self._open(path)

    def _open(self, path: Path) -> None:
        self._file = self._opened(path)
        self.files.append(path)
        self._since_s, self._frames = monotonic(), 0

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write a frame."""
        self._file.write(frame, bus)
        self._frames += 1

    def flush(self) -> None:
        """Flush to the system; begin a new file if due."""
        self._file.flush()
        if self._frames and self._is_full:
            self.close()
            self._open(next_part(self._path))

    @property
    def _is_full(self) -> bool:
        seconds, most = self._rotation.seconds, self._rotation.size_bytes
        return bool((seconds and monotonic() - self._since_s >= seconds) or (most and self._file.size >= most))

    def close(self) -> None:
        """Complete the open file."""
        self._file.close()
        self.size += self._file.size


def next_part(path: Path) -> Path:
    """Return the first free name of `run.parquet`, `run-0002.parquet`, … after all finished and unfinished files."""
    numbers = [number for number, _ in _parts(path, "_?", f"(?:{re.escape(path.suffix)}|{re.escape(STREAM)})")]
    return _part(path, max(numbers, default=0) + 1)


def finish_parts(path: Path) -> list[tuple[Path, int]]:
    """Complete files left by killed recordings into the .parquet file *path*; returns each with its rows.

    If a file of that name has another recording by now, the next free name is taken.
    """
    from dvtcli.files.values.parquet_file import finish, has_rows_of

    finished: list[tuple[Path, int]] = []
    for number, stream in sorted(_parts(path, "_", re.escape(STREAM))):
        if not stream.is_file():  # a pipe of that name would be waited for
            continue
        whole = _part(path, number)
        if whole.exists() and not has_rows_of(whole, stream):
            whole = next_part(path)
        count = finish(stream, whole)
        if count is not None:
            finished.append((whole, count))
    return finished


def _part(path: Path, number: int) -> Path:
    return path if number == 1 else path.with_name(f"{path.stem}-{number:04}{path.suffix}")


def _parts(path: Path, before: str, after: str) -> list[tuple[int, Path]]:
    """Return the numbered parts beside *path*; *before* and *after* are patterns around the stem."""
    names = re.compile(rf"{before}{re.escape(path.stem)}(?:-([0-9]{{4,9}}))?{after}")
    beside = [*path.parent.iterdir()] if path.parent.is_dir() else []
    return [(int(found[1] or 1), each) for each in beside if (found := names.fullmatch(each.name))]
