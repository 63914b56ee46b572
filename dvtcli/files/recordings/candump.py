"""candump's log; reads all kinds of error frames, and keeps the length of remote frames."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.domain.ports import Frame
from dvtcli.files.recordings.recording_format import CountedLines, LostLineError, RecordedFrame, RecordingFormat

#: a data frame of candump: time, channel, CAN-ID, data; every match is a valid frame
_DATA_FRAME = re.compile(
    r"\((?P<time>[0-9]{1,10}\.[0-9]{1,9})\) (?P<channel>\S+)"
    r" (?P<can_id>[0-7][0-9A-Fa-f]{2}|[01][0-9A-Fa-f]{7})#(?P<data>(?:[0-9A-Fa-f]{2}){0,8})(?: [RTrt])?\s*",
    re.ASCII,  # without re.IGNORECASE, which takes half as long again
)
#: CAN-IDs with the error flag (linux/can.h)
_ERROR_FRAME = re.compile(r" [2367][0-9A-F]{7}#", re.I)


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
        data_frame = _DATA_FRAME.fullmatch
        for line, text in source.lines():
            found = data_frame(text)
            if found is None:
                yield from _by_python_can(line, text)
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


def _by_python_can(line: int, text: str) -> Iterator[can.Message]:
    """Parse the frame in *text*, if any; maps all error frames to the kind that python-can recognises."""
    time, *_ = text.split() or ["()"]
    if time[0] != "(" or time[-1] != ")":  # python-can cuts off one character at each end, whichever it is
        raise LostLineError(line, text)
    return iter(can.CanutilsLogReader(StringIO(_ERROR_FRAME.sub(" 20000080#", text))))
