"""candump's log: error frames of every kind are read as such, and remote frames keep their length."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.files.recorded_lines import CountedLines, LostLineError
from dvtcli.files.recordings.recording_format import RecordingFormat

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
        """Its lines."""
        return _CandumpLines(raw, encoding="utf-8", errors="replace")

    def reader(self, source: Any) -> Iterator[can.Message]:
        """The frames, line by line."""
        return iter(can.CanutilsLogReader(source))

    def write(self, writer: Any, message: can.Message) -> None:
        """Write *message*; python-can leaves out how many bytes a remote frame asks for."""
        if message.is_remote_frame and message.dlc:
            can_id = f"{message.arbitration_id:0{8 if message.is_extended_id else 3}X}"
            writer.file.write(f"({message.timestamp:f}) {message.channel} {can_id}#R{message.dlc} R\n")
        else:
            super().write(writer, message)


class _CandumpLines(CountedLines):
    """Its lines: python-can knows one kind of error frame, and takes the others for data; they become that."""

    def __next__(self) -> str:  # type: ignore[override]
        text = super().__next__()
        time, *_ = text.split() or ["()"]
        if time[0] != "(" or time[-1] != ")":  # python-can cuts off one character at each end, whichever it is
            raise LostLineError(self.line, text)
        return _ERROR_FRAME.sub(r" 20000080#", text)
