"""The frames of a recording, as its file has them. Knows no bus and no PDO."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import can

from dvtcli.bus.can_message import frame_of
from dvtcli.domain.cob_id import fits
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.several import plural
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.input_file import open_input, read_input
from dvtcli.files.recorded_lines import CountedLines, LeftLines, LostLineError, NoFrameError, no_frame
from dvtcli.files.recording_formats import format_of
from dvtcli.files.recordings.recording_format import RecordingFormat

#: the times that frames may have, in seconds since 1970: those of the years 1653 to 5138
_FIRST_S, _LAST_S = -1e10, 1e11
_MOST_BYTES, _MOST_FD_BYTES, _MOST_CODE = 8, 64, 15
#: how long a file (bytes) is read once more, without a line that is damaged
_MOST_TRIED = 50_000_000


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """One frame of a recording, with the name of the *channel* it came from; an *error* frame, or one of CAN *fd*."""

    frame: Frame
    channel: str = ""
    error: bool = False
    fd: bool = False


def read_recording(path: Path) -> Iterator[Frame]:
    """The frames of *path* in its order; error frames are left out. Errors as `read_recorded`."""
    return (frame.frame for frame in read_recorded(path) if not frame.error)


def read_recorded(path: Path) -> Iterator[RecordedFrame]:
    """All that is in *path*, in its order.

    UsageError where the file is missing or its format unknown; InputFileError, with the line where it is known, where
    it is damaged or holds no frame.
    """
    kind = format_of(path, reading=True)
    with _opened(path) as raw:
        source = kind.source(raw, path)
        count = 0
        try:
            for frame in _all_in(kind, source):
                count += not frame.error
                yield frame
        except kind.broken as wrong:
            raise _damaged(path, kind, source, count, wrong) from wrong
    if not count:
        raise InputFileError(f"{path.name} holds no frame", hint=f"is it a {kind.suffix} file?", place=str(path))


def _all_in(kind: RecordingFormat, source: Any) -> Iterator[RecordedFrame]:
    """All that is in *source*; an error that *kind* knows where it is damaged."""
    for message in kind.reader(source):
        if isinstance(source, LeftLines):
            source.took()
        if not message.is_error_frame:
            _refuse_no_date(message.timestamp)
            _refuse_no_id(message)
            _refuse_other_length(message)
        channel = "" if message.channel is None else str(message.channel)
        fd = message.is_fd or len(message.data) > _MOST_BYTES
        yield RecordedFrame(frame_of(message), channel, message.is_error_frame, fd)


def _refuse_no_date(time_s: float) -> None:
    """NoFrameError for a time that no calendar has: neither from a recording's own start nor since 1970."""
    if not _FIRST_S <= time_s <= _LAST_S:
        raise NoFrameError(f"{time_s:g} s is no time of a frame")


def _refuse_no_id(message: can.Message) -> None:
    """NoFrameError for a CAN-ID that no frame can have: an interface that is given it cuts it to another one."""
    if not fits(message.arbitration_id, extended=message.is_extended_id):
        bits = 29 if message.is_extended_id else 11
        raise NoFrameError(f"CAN-ID 0x{message.arbitration_id:X} has more than {bits} bits")


def _refuse_other_length(message: can.Message) -> None:
    """NoFrameError if it has other data than its length says, as a part is missing, or more than CAN FD has."""
    if len(message.data) > _MOST_FD_BYTES:
        raise NoFrameError(f"a frame of {len(message.data)} bytes; CAN FD has {_MOST_FD_BYTES} at most")
    if not message.is_remote_frame and len(message.data) not in _lengths(message):
        raise NoFrameError(f"a frame of {plural(message.dlc, 'byte')} has {len(message.data)}")


def _lengths(message: can.Message) -> set[int]:
    """The bytes that it may have: some formats keep a length's code, which for 9 to 15 means 8, or more of CAN FD."""
    is_code = _MOST_BYTES < message.dlc <= _MOST_CODE
    return {message.dlc} | ({_MOST_BYTES, can.util.dlc2len(message.dlc)} if is_code else set())


def check_readable(path: Path) -> None:
    """UsageError where *path* is missing or its format unknown: said before anything else is asked for."""
    format_of(path, reading=True)
    if not path.is_fifo():  # what is in a pipe comes once
        _opened(path).close()


def _opened(path: Path) -> BinaryIO:
    try:
        return open_input(path)
    except OSError as failed:
        raise UsageError(
            f"{path}: {failed.strerror or failed}", hint=Hint(Action.LOG, {"file": path}, "records one")
        ) from failed


def _damaged(path: Path, kind: RecordingFormat, source: Any, count: int, wrong: Exception) -> InputFileError:
    line = _line(source, wrong)
    place = f"{path}:{line}" if line else str(path)
    return InputFileError(
        f"{place}: damaged after {plural(count, 'frame')}, or no {path.suffix} file", why=_why(kind, source, wrong),
        place=place, hint=_without(path, kind, line) if line else "",
    )  # fmt: skip


def _line(source: Any, wrong: Exception) -> int:
    return wrong.line if isinstance(wrong, LostLineError) else getattr(source, "line", 0)


def _without(path: Path, kind: RecordingFormat, line: int) -> str:
    """Whether *path* can be read without *line*, tried; where another one is damaged, too, which."""
    if not path.is_file() or path.stat().st_size > _MOST_TRIED:
        return ""
    lines = read_input(path, _MOST_TRIED, "recording that is tried").splitlines(keepends=True)
    source = kind.source(BytesIO(b"".join((*lines[: line - 1], *lines[line:]))), path)
    try:
        has_frames = sum(not frame.error for frame in _all_in(kind, source)) > 0
    except kind.broken as wrong:
        other = _line(source, wrong)
        return f"line {other + (other >= line)} is damaged, too" if other else ""
    return f"without line {line} the rest of it can be read" if has_frames else ""


def _why(kind: RecordingFormat, source: Any, wrong: Exception) -> str:
    """What is wrong, not how its reader says it."""
    if isinstance(wrong, NoFrameError) or kind.tells:
        return str(wrong).partition("\n")[0] or type(wrong).__name__
    if isinstance(source, CountedLines):
        return no_frame(source.text)
    return "a part of it cannot be unpacked"
