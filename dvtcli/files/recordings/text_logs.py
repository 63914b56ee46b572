"""Logs in text that python-can reads, its errors mended: candump's .log, PEAK's .trc and Vector's .asc."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_format import (
    CountedLines,
    LeftLines,
    LostLineError,
    RecordedFrame,
    RecordingFormat,
)

#: a data frame of candump: time, channel, CAN-ID, data; every match is a valid frame
_CANDUMP_FRAME = re.compile(
    r"\((?P<time>[0-9]{1,10}\.[0-9]{1,9})\) (?P<channel>\S+)"
    r" (?P<can_id>[0-7][0-9A-Fa-f]{2}|[01][0-9A-Fa-f]{7})#(?P<data>(?:[0-9A-Fa-f]{2}){0,8})(?: [RTrt])?\s*",
    re.ASCII,  # without re.IGNORECASE, which takes half as long again
)
#: CAN-IDs with the error flag (linux/can.h)
_CANDUMP_ERROR = re.compile(r" [2367][0-9A-F]{7}#", re.I)


class CandumpFormat(RecordingFormat):
    """candump's .log."""

    suffix = ".log"
    title = "candump"
    appends = True
    rotates = True
    flushes = True

    def source(self, raw: BinaryIO, _path: Path) -> Any:
        """Return the file's lines."""
        return CountedLines(raw)

    def reader(self, source: Any) -> Iterator[can.Message | RecordedFrame]:
        """The frames, line by line; python-can reads the lines that are no usual data frame."""
        data_frame = _CANDUMP_FRAME.fullmatch
        for line, text in source.lines():
            found = data_frame(text)
            if found is None:
                yield from _candump_by_python_can(line, text)
                continue
            time, channel, can_id, data = found.groups()
            frame = Frame(int(can_id, 16), bytes.fromhex(data), len(can_id) > 3, False, float(time))
            yield RecordedFrame(frame, str(int(channel)) if channel.isdigit() else channel)

    def write(self, writer: Any, frame: Frame) -> None:
        """Write *frame* as python-can's *writer* does, in a third of its time; with the length that a remote frame has.

        No time is before that of the first frame.
        """
        first_s = writer.last_timestamp
        if first_s is None:
            first_s = writer.last_timestamp = frame.timestamp_s
        can_id = f"{frame.can_id:0{8 if frame.extended else 3}X}"
        said = f"R{frame.dlc or ''}" if frame.remote else frame.data.hex().upper()
        writer.file.write(f"({max(frame.timestamp_s, first_s):f}) can0 {can_id}#{said} R\n")


def _candump_by_python_can(line: int, text: str) -> Iterator[can.Message]:
    """Parse the frame in *text*, if any; maps all error frames to the kind that python-can recognises."""
    time, *_ = text.split() or ["()"]
    if time[0] != "(" or time[-1] != ")":  # python-can cuts off one character at each end, whichever it is
        raise LostLineError(line, text)
    return iter(can.CanutilsLogReader(StringIO(_CANDUMP_ERROR.sub(" 20000080#", text))))


#: kinds of events that are no frames; in version 1 an impossible CAN-ID
_TRC_EVENTS = frozenset({"ST", "ER", "EC", "EV", "Warng", "Error", "FFFFFFFF"})
#: the kind in a line: after number and time, or after the bus that follows them
_TRC_KIND = slice(2, 4)


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
        return bool(words) and not words[0].startswith(";") and _TRC_EVENTS.isdisjoint(words[_TRC_KIND])


#: lines without a time: comments, header, triggers
_ASC_ASIDE = re.compile(r"//|;|date\b|base\b|(no )?\s*internal\s+events|begin\b|end\b|previous log", re.I)
_ASC_TIME, _ASC_ID = re.compile(r"\d+\.\d+", re.ASCII), re.compile(r"[0-9A-F]+x?", re.I | re.ASCII)
_ASC_RELATIVE = re.compile(r"\s*base\s+\w+\s+timestamps\s+relative", re.I)
_ASC_FRAME = re.compile(r"\b[RT]x\s+[dr]\b", re.I)
#: beginnings of events that are no frames: `Statistic:`, `J1939TP`, `SV:`
_ASC_WORD = re.compile(r"[A-Za-z][\w:/]*", re.ASCII)


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
        if self.has_time or not _ASC_TIME.match(text.strip()):
            return text
        self.has_time, self.held = True, text
        return "\n"

    def _absolute(self, text: str) -> str:
        """*text* with its time from the beginning; python-can takes times from line to line for such times."""
        if self.total_s is None:
            self.total_s = 0.0 if _ASC_RELATIVE.match(text) else None
            return text
        time = _ASC_TIME.match(text.lstrip())
        if time is None:
            return text
        self.total_s += float(time[0])
        return text.replace(time[0], f"{self.total_s:.6f}", 1)

    def is_lost(self, text: str) -> bool:
        """Whether the line is neither header, comment nor another kind of event."""
        words = text.split()
        if not words or _ASC_ASIDE.match(text.strip()):
            return False
        if not words[0][0].isdigit():
            return self.begun or self.has_time
        if not _ASC_TIME.fullmatch(words[0]) or len(words) == 1:
            return True
        kind = words[2] if words[1].isdigit() and len(words) > 2 else words[1]
        if _ASC_ID.fullmatch(kind) or not _ASC_WORD.fullmatch(kind):
            return True
        return _ASC_FRAME.search(text) is not None and not kind.upper().startswith("J1939")
