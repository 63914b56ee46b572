"""Vector's ASCII: what python-can's reader passes by is told, and what its writer writes wrongly is avoided."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.files.recorded_lines import LeftLines
from dvtcli.files.recordings.recording_format import RecordingFormat

#: lines that have no time: comments, its header, triggers
_ASIDE = re.compile(r"//|;|date\b|base\b|(no )?\s*internal\s+events|begin\b|end\b|previous log", re.I)
_TIME, _ID = re.compile(r"\d+\.\d+", re.ASCII), re.compile(r"[0-9A-F]+x?", re.I | re.ASCII)
_DATA_FRAME = re.compile(r"\b[RT]x\s+[dr]\b", re.I)
#: what begins an event that is no frame: `Statistic:`, `J1939TP`, `SV:`
_WORD = re.compile(r"[A-Za-z][\w:/]*", re.ASCII)


class AscFormat(RecordingFormat):
    """Vector's .asc."""

    suffix = ".asc"
    title = "Vector ASCII"
    rotates = True
    flushes = True

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """Its lines."""
        return _AscLines(raw, encoding="utf-8", errors="replace")

    def reader(self, source: Any) -> Iterator[can.Message]:
        """The frames, with the times that they had."""
        return iter(can.ASCReader(source, relative_timestamp=False))

    def write(self, writer: Any, message: can.Message) -> None:
        """Write *message*.

        Times count from the beginning in its head, whose milliseconds python-can writes without leading zeros (.001
        becomes .1): it begins at a whole second.
        """
        if not writer.header_written:
            writer.log_event("Start of measurement", float(int(message.timestamp)))
        super().write(writer, message)

    def note(self, writer: Any, text: str, time_s: float) -> None:
        """An event between the frames, as soon as there is one."""
        if writer.header_written:
            writer.log_event(text, time_s)


class _AscLines(LeftLines):
    """Its lines. python-can's reader takes the first line behind the header for a part of it."""

    held = ""
    has_time = False

    def __next__(self) -> str:  # type: ignore[override]
        if self.held:
            text, self.held = self.held, ""
            return text
        text = super().__next__()
        if self.has_time or not _TIME.match(text.strip()):
            return text
        self.has_time, self.held = True, text
        return "\n"

    def is_lost(self, text: str) -> bool:
        """Whether it is neither header, comment nor an event of another kind."""
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
