"""Values in one file after the other: `run.parquet`, `run-0002.parquet`, …, each whole when the next one begins.

What a `log` left that was killed becomes a whole file first. Knows no form but for that.
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
    """When a new file begins: after *seconds* or after *size_bytes*; 0 of either: never for that."""

    seconds: float = 0.0
    size_bytes: int = 0


class ValueParts:
    """Writes frames into files that *opened* opens, the first at *path*, the next ones by *rotation*."""

    def __init__(self, path: Path, opened: Callable[[Path], ValueWriter], rotation: Rotation) -> None:
        self._path, self._opened, self._rotation = path, opened, rotation
        #: the files, in their order, and the bytes of those that are closed
        self.files: list[Path] = []
        self.size = 0
        self._open(path)

    def _open(self, path: Path) -> None:
        self._file = self._opened(path)
        self.files.append(path)
        self._since_s, self._frames = monotonic(), 0

    def write(self, frame: Frame, bus: str = "") -> None:
        """Write one frame."""
        self._file.write(frame, bus)
        self._frames += 1

    def flush(self) -> None:
        """Hand what was written to the system; begin a new file if it is time."""
        self._file.flush()
        if self._frames and self._is_full:
            self.close()
            self._open(next_part(self._path))

    @property
    def _is_full(self) -> bool:
        seconds, most = self._rotation.seconds, self._rotation.size_bytes
        return bool((seconds and monotonic() - self._since_s >= seconds) or (most and self._file.size >= most))

    def close(self) -> None:
        """Write the end of the open file."""
        self._file.close()
        self.size += self._file.size


def next_part(path: Path) -> Path:
    """The first of `run.parquet`, `run-0002.parquet`, … behind all that are there or being written."""
    numbers = [number for number, _ in _parts(path, "_?", f"(?:{re.escape(path.suffix)}|{re.escape(STREAM)})")]
    return _part(path, max(numbers, default=0) + 1)


def finish_parts(path: Path) -> list[tuple[Path, int]]:
    """Make whole files of what killed recordings into *path*, a .parquet file, left; each with its number of rows."""
    from dvtcli.files.values.parquet_file import finish

    found = sorted(_parts(path, "_", re.escape(STREAM)))
    rows = [(whole, finish(stream, whole)) for number, stream in found for whole in [_part(path, number)]]
    return [(whole, count) for whole, count in rows if count is not None]


def _part(path: Path, number: int) -> Path:
    return path if number == 1 else path.with_name(f"{path.stem}-{number:04}{path.suffix}")


def _parts(path: Path, before: str, after: str) -> list[tuple[int, Path]]:
    """The files beside *path* that are parts of it, with their numbers; patterns say what stands about their stems."""
    names = re.compile(rf"{before}{re.escape(path.stem)}(?:-([0-9]{{4,9}}))?{after}")
    beside = [*path.parent.iterdir()] if path.parent.is_dir() else []
    return [(int(found[1] or 1), each) for each in beside if (found := names.fullmatch(each.name))]
