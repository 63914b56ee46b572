"""Vector's binary log: one that is shorter than it says itself is told."""

from __future__ import annotations

from collections.abc import Iterator
from os import fstat
from pathlib import Path
from typing import Any, BinaryIO

import can
from can.io.blf import BLFParseError

from dvtcli.files.recorded_lines import NoFrameError
from dvtcli.files.recordings.recording_format import RecordingFormat


class BlfFormat(RecordingFormat):
    """Vector's .blf, which keeps a block back until it is full or closed."""

    suffix = ".blf"
    title = "Vector binary"
    appends = True
    rotates = True
    broken = (*RecordingFormat.broken, BLFParseError)

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """The file itself, whose size is asked for."""
        return raw

    def reader(self, source: Any) -> Iterator[can.Message]:
        """The frames; NoFrameError behind the last one where the file is shorter than it says itself."""
        blocks, size = can.BLFReader(source), fstat(source.fileno()).st_size
        yield from blocks
        if size < blocks.file_size:
            raise NoFrameError(f"it was cut short: of {blocks.file_size} bytes it has {size}")


FORMATS = (BlfFormat(),)
