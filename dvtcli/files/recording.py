"""The frames of a recording, as its file has them. Knows no bus and no PDO."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.bus.can_message import frame_of
from dvtcli.domain.cob_id import fits
from dvtcli.domain.ports import Frame
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.recording_formats import BROKEN, CAPTURES, TEXT, checked_suffix

#: the times that frames may have, in seconds since 1970: those of the years 1653 to 5138
_FIRST_S, _LAST_S = -1e10, 1e11
_MOST_BYTES = 8
#: candump's CAN-IDs with the error flag (linux/can.h)
_ERROR_FRAME = re.compile(r" [2367][0-9A-F]{7}#", re.I)


class _CountedLines(TextIOWrapper):
    """A text file that knows which line was read last."""

    line = 0

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        self.line += 1
        return super().readline(size)

    def __next__(self) -> str:  # type: ignore[override]
        text = self.readline()
        if not text:
            raise StopIteration
        return text


class _CandumpLines(_CountedLines):
    """candump's lines: python-can knows one kind of error frame, and takes the others for data; they become that."""

    def __next__(self) -> str:  # type: ignore[override]
        return _ERROR_FRAME.sub(r" 20000080#", super().__next__())


@dataclass(frozen=True, slots=True)
class Recorded:
    """One frame of a recording, with the name of the *channel* it came from; an *error* frame, or one of CAN *fd*."""

    frame: Frame
    channel: str = ""
    error: bool = False
    fd: bool = False


def read_recording(path: Path) -> Iterator[Frame]:
    """The frames of *path* in its order; error frames are left out. Errors as `read_recorded`."""
    return (one.frame for one in read_recorded(path) if not one.error)


def read_recorded(path: Path) -> Iterator[Recorded]:
    """All that is in *path*, in its order.

    UsageError where the file is missing or its format unknown; InputFileError, with the line where it is known, where
    it is damaged or holds no frame.
    """
    suffix = checked_suffix(path, reading=True)
    with _opened(path) as raw:
        source = _source(suffix, raw, path)
        count = 0
        try:
            for message in _reader(suffix, source):
                if not message.is_error_frame:
                    _refuse_no_date(message.timestamp)
                    _refuse_no_id(message)
                    count += 1
                channel = "" if message.channel is None else str(message.channel)
                fd = message.is_fd or len(message.data) > _MOST_BYTES
                yield Recorded(frame_of(message), channel, message.is_error_frame, fd)
        except (*BROKEN, can.CanError) as wrong:
            raise _damaged(path, source, count, wrong) from wrong
    if not count:
        raise InputFileError(f"{path.name} holds no frame", hint=f"is it a {suffix} file?", place=str(path))


def _refuse_no_date(time_s: float) -> None:
    """ValueError for a time that no calendar has: neither from a recording's own start nor since 1970."""
    if not _FIRST_S <= time_s <= _LAST_S:
        raise ValueError(f"{time_s:g} s is no time of a frame")


def _refuse_no_id(message: can.Message) -> None:
    """ValueError for a CAN-ID that no frame can have: an interface that is given it cuts it to another one."""
    if not fits(message.arbitration_id, extended=message.is_extended_id):
        bits = 29 if message.is_extended_id else 11
        raise ValueError(f"CAN-ID 0x{message.arbitration_id:X} has more than {bits} bits")


def check_readable(path: Path) -> None:
    """UsageError where *path* is missing or its format unknown: said before anything else is asked for."""
    checked_suffix(path, reading=True)
    _opened(path).close()


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as failed:
        raise UsageError(f"{path}: {failed.strerror or failed}", hint="`log FILE` records one") from failed


def _source(suffix: str, raw: Any, path: Path) -> Any:
    """What the format's reader takes: lines that are counted, the open file, or its path."""
    if suffix in TEXT:
        kind = _CandumpLines if suffix == ".log" else _CountedLines
        return kind(raw, encoding="utf-8", errors="replace")
    return raw if suffix in (".blf", *CAPTURES) else str(path)


def _reader(suffix: str, source: Any) -> Iterator[can.Message]:
    if suffix == ".asc":
        return iter(can.ASCReader(source, relative_timestamp=False))
    if suffix in CAPTURES:
        from dvtcli.files.pcap import read_capture

        return read_capture(source)
    readers: dict[str, Any] = {".log": can.CanutilsLogReader, ".trc": can.TRCReader, ".blf": can.BLFReader}
    return iter(readers[suffix](source) if suffix in readers else can.LogReader(source))


def _damaged(path: Path, source: Any, count: int, wrong: Exception) -> InputFileError:
    line = getattr(source, "line", 0)
    why = str(wrong).partition("\n")[0] or type(wrong).__name__
    place = f"{path}:{line}" if line else str(path)
    return InputFileError(f"{place}: damaged after {count} frames, or no {path.suffix} file", why=why, place=place)
