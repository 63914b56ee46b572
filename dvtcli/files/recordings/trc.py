"""PEAK's trace; reports lines skipped by python-can's reader."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.files.recordings.recording_format import LeftLines, RecordingFormat

#: kinds of events that are no frames; in version 1 an impossible CAN-ID
_EVENTS = frozenset({"ST", "ER", "EC", "EV", "Warng", "Error", "FFFFFFFF"})
#: the kind in a line: after number and time, or after the bus that follows them
_KIND = slice(2, 4)


class TrcFormat(RecordingFormat):
    """PEAK's .trc; its writer omits remote frames."""

    suffix = ".trc"
    title = "PEAK"
    keeps_remote = False
    flushes = True

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """Return the file's lines."""
        return _TrcLines(raw)

    def reader(self, source: Any) -> Iterator[can.Message]:
        """The frames, line by line."""
        return iter(can.TRCReader(source))


class _TrcLines(LeftLines):
    """Lines of a .trc file."""

    def is_lost(self, text: str) -> bool:
        """Whether the line is neither comment nor another kind of event."""
        words = text.split()
        return bool(words) and not words[0].startswith(";") and _EVENTS.isdisjoint(words[_KIND])
