"""PEAK's trace: what python-can's reader passes by is told."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.files.recorded_lines import LeftLines
from dvtcli.files.recordings.recording_format import RecordingFormat

#: kinds of events that are no frames; in its first version a CAN-ID that no frame has
_EVENTS = frozenset({"ST", "ER", "EC", "EV", "Warng", "Error", "FFFFFFFF"})
#: where a line says its kind: behind number and time, or behind the bus that follows them
_KIND = slice(2, 4)


class TrcFormat(RecordingFormat):
    """PEAK's .trc, whose writer leaves out remote frames."""

    suffix = ".trc"
    title = "PEAK"
    keeps_remote = False
    flushes = True

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """Its lines."""
        return _TrcLines(raw, encoding="utf-8", errors="replace")

    def reader(self, source: Any) -> Iterator[can.Message]:
        """The frames, line by line."""
        return iter(can.TRCReader(source))


class _TrcLines(LeftLines):
    """Its lines."""

    def is_lost(self, text: str) -> bool:
        """Whether it is neither comment nor an event of another kind."""
        words = text.split()
        return bool(words) and not words[0].startswith(";") and _EVENTS.isdisjoint(words[_KIND])
