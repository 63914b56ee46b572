"""Vector's ASCII: reports lines skipped by python-can's reader, and avoids errors of its writer."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_format import LeftLines, RecordingFormat

#: lines without a time: comments, header, triggers
_ASIDE = re.compile(r"//|;|date\b|base\b|(no )?\s*internal\s+events|begin\b|end\b|previous log", re.I)
_TIME, _ID = re.compile(r"\d+\.\d+", re.ASCII), re.compile(r"[0-9A-F]+x?", re.I | re.ASCII)
_RELATIVE = re.compile(r"\s*base\s+\w+\s+timestamps\s+relative", re.I)
_DATA_FRAME = re.compile(r"\b[RT]x\s+[dr]\b", re.I)
#: beginnings of events that are no frames: `Statistic:`, `J1939TP`, `SV:`
_WORD = re.compile(r"[A-Za-z][\w:/]*", re.ASCII)


class AscFormat(RecordingFormat):
    """Vector's .asc."""

    suffix = ".asc"
    title = "Vector ASCII"
    rotates = True
    flushes = True

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """Return the file's lines."""
        return _AscLines(raw)

    def reader(self, source: Any) -> Iterator[can.Message]:
        """Iterate over frames with their original times."""
        return iter(can.ASCReader(source, relative_timestamp=False))

    def write(self, writer: Any, frame: Frame) -> None:
        """Write *frame*; the recording begins at a whole second.

        Times count from the beginning in the header, and python-can writes its milliseconds without leading zeros (.001
        becomes .1).
        """
        if not writer.header_written:
            writer.log_event("Start of measurement", float(int(frame.timestamp_s)))
        super().write(writer, frame)

    def note(self, writer: Any, text: str, time_s: float) -> None:
        """Write an event between frames, once the file has a frame."""
        if writer.header_written:
            writer.log_event(text, time_s)


class _AscLines(LeftLines):
    """Lines of an .asc file; python-can's reader takes the first line after the header for a part of it."""

    held = ""
    has_time = False
    #: the time so far (s) of a file whose times are from line to line, None for other files
    total_s: float | None = None

    def __next__(self) -> str:  # type: ignore[override]
        if self.held:
            text, self.held = self.held, ""
            return text
        text = self._absolute(super().__next__())
        if self.has_time or not _TIME.match(text.strip()):
            return text
        self.has_time, self.held = True, text
        return "\n"

    def _absolute(self, text: str) -> str:
        """*text* with its time from the beginning; python-can takes times from line to line for such times."""
        if self.total_s is None:
            self.total_s = 0.0 if _RELATIVE.match(text) else None
            return text
        time = _TIME.match(text.lstrip())
        if time is None:
            return text
        self.total_s += float(time[0])
        return text.replace(time[0], f"{self.total_s:.6f}", 1)

    def is_lost(self, text: str) -> bool:
        """Whether the line is neither header, comment nor another kind of event."""
        words = text.split()
        if not words or _ASIDE.match(text.strip()):
            return False
        if not words[0][0].isdigit():
            return self.begun or self.has_time
        if not _TIME.fullmatch(words[0]) or len(words) == 1:
            return True
        kind = words[2] if words[1].isdigit() and len(words) > 2 else words[1]
        if _ID.fullmatch(kind) or not _WORD.fullmatch(kind):
            return True
        return _DATA_FRAME.search(text) is not None and not kind.upper().startswith("J1939")
