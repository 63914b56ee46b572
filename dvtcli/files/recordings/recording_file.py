"""Read the frames of a recording, and write a recording: in lossless formats only."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BufferedReader, BytesIO
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import can

from dvtcli.bus.can_message import frame_of
from dvtcli.domain.cob_id import fits
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.input_file import open_input, read_input
from dvtcli.files.recordings.formats import MOST_WORDS, format_of, formats, recognised, written
from dvtcli.files.recordings.recording_format import (
    UTF_16,
    CountedLines,
    LeftLines,
    LostLineError,
    NoFrameError,
    RecordedFrame,
    RecordingFormat,
    encoding_of,
    message_of,
    no_frame,
)

#: valid times of frames (s since 1970): years 1653 to 5138
_FIRST_S, _LAST_S = -1e10, 1e11
_MOST_BYTES, _MOST_FD_BYTES, _MOST_CODE = 8, 64, 15
#: maximum size (bytes) of a file to read again without a damaged line
_MOST_TRIED = 50_000_000


def read_recording(path: Path) -> Iterator[Frame]:
    """Iterate over the frames of *path* in order, without error and CAN FD frames; raises as `read_recorded`."""
    return (frame.frame for frame in read_recorded(path) if not frame.error and not frame.fd)


def read_recorded(path: Path) -> Iterator[RecordedFrame]:
    """Iterate over all frames of *path* in order, with error frames.

    Raises UsageError if the file is missing or its format unknown; InputFileError, with the line if known, if it is
    damaged or has no frame.
    """
    kind = recognised(path)
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
        raise InputFileError(f"{path.name} has no frames", hint=f"is it a {kind.suffix} file?", place=str(path))


def _all_in(kind: RecordingFormat, source: Any) -> Iterator[RecordedFrame]:
    """Iterate over frames of *source*; raises an error known to *kind* if damaged."""
    took = source.took if isinstance(source, LeftLines) else None
    for message in kind.reader(source):
        if isinstance(message, RecordedFrame):
            yield message
            continue
        if took is not None:
            took()
        if not message.is_error_frame:
            _require_frame(message)
        channel = message.channel
        fd = message.is_fd or len(message.data) > _MOST_BYTES
        yield RecordedFrame(frame_of(message), "" if channel is None else str(channel), message.is_error_frame, fd)


def _require_frame(message: can.Message) -> None:
    """Raise NoFrameError for an impossible time, CAN-ID or length.

    An interface would truncate an impossible CAN-ID to another CAN-ID; data is shorter if a part is missing.
    """
    time_s, can_id, length = message.timestamp, message.arbitration_id, len(message.data)
    if not _FIRST_S <= time_s <= _LAST_S:
        raise NoFrameError(f"{time_s:g} s is not a time of a frame")
    if not fits(can_id, extended=message.is_extended_id):
        raise NoFrameError(f"CAN-ID 0x{can_id:X} has more than {29 if message.is_extended_id else 11} bits")
    if length > _MOST_FD_BYTES:
        raise NoFrameError(f"a frame of {length} bytes; CAN FD has {_MOST_FD_BYTES} at most")
    if length != message.dlc and not message.is_remote_frame and length not in _lengths(message):
        raise NoFrameError(f"a frame of {plural(message.dlc, 'byte')} has {length}")


def _lengths(message: can.Message) -> set[int]:
    """Return other valid lengths in bytes: some formats keep a code, and 9 to 15 means 8 or more."""
    is_code = _MOST_BYTES < message.dlc <= _MOST_CODE
    return {_MOST_BYTES, can.util.dlc2len(message.dlc)} if is_code else set()


def check_readable(path: Path) -> None:
    """Raise UsageError if *path* is missing or its format unknown, before asking for anything else."""
    recognised(path)
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
    said = f"no {path.suffix} file" if path.suffix.lower() in formats() else f"not {kind.title} throughout"
    text = f"{place}: damaged after {plural(count, 'frame')}, or {said}"
    return InputFileError(
        text, why=_why(kind, source, wrong),
        place=place, hint=_without(path, kind, line, is_first=not count) if line else "",
    )  # fmt: skip


def _line(source: Any, wrong: Exception) -> int:
    return wrong.line if isinstance(wrong, LostLineError) else getattr(source, "line", 0)


def _without(path: Path, kind: RecordingFormat, line: int, *, is_first: bool) -> str:
    """Try to read *path* without *line*; returns the result, or another damaged line.

    *is_first*: no frame is before it. Then further lines may be words in front of the frames, as people paste them.
    """
    if not path.is_file() or path.stat().st_size > _MOST_TRIED:
        return ""
    data = read_input(path, _MOST_TRIED, "recording that is tried")
    if (encoding := encoding_of(data)) == UTF_16:
        data = data.decode(encoding, "replace").encode()
    lines = data.splitlines(keepends=True)
    other, last = 0, line
    for _ in range(MOST_WORDS if is_first else 1):
        count = 0
        source = kind.source(BufferedReader(BytesIO(b"".join((*lines[: line - 1], *lines[last:])))), path)
        try:
            for frame in _all_in(kind, source):
                count += not frame.error
        except kind.broken as wrong:
            damaged = _line(source, wrong)
            if damaged >= line:
                damaged += last - line + 1
            other = other or damaged
            if count or damaged <= last:
                break
            last = damaged
        else:
            left_out = f"line {line}" if last == line else f"lines {line} to {last}"
            return f"without {left_out} the rest of it can be read" if count else ""
    return f"line {other} is damaged, too" if other else ""


def _why(kind: RecordingFormat, source: Any, wrong: Exception) -> str:
    """Return the cause in dvtcli's words instead of the reader's."""
    if isinstance(wrong, NoFrameError) or kind.tells:
        return str(wrong).partition("\n")[0] or type(wrong).__name__
    if isinstance(source, CountedLines):
        return no_frame(source.text)
    return "a part of it cannot be unpacked"


class Recorder:
    """Writes frames to *path*; *append*: after existing frames; *most_bytes* > 0: into a series of files.

    Raises UsageError if the format cannot do so or the file cannot be created. Use as a context manager.
    """

    def __init__(self, path: Path, *, append: bool = False, most_bytes: int = 0) -> None:
        self.path = path
        self._format = format_of(path)
        if append and not self._format.appends:
            raise _cannot(path, "nothing can be appended", lambda file_format: file_format.appends)
        if most_bytes and not self._format.rotates:
            raise _cannot(path, "files cannot be rotated", lambda file_format: file_format.rotates)
        self.frames = 0
        #: frames not supported by the format
        self.left_out = 0
        try:
            self._writer: Any = self._format.writer(path, append=append, most_bytes=most_bytes)
        except OSError as failed:
            raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
        except self._format.broken as wrong:
            raise InputFileError(f"{path}: it cannot be appended to", why=str(wrong), place=str(path)) from wrong

    def write(self, frame: Frame) -> None:
        """Write a frame. Raises DvtcliError if the disk is full or fails."""
        if frame.remote and not self._format.keeps_remote:
            self.left_out += 1
            return
        try:
            self._format.write(self._file_for(frame), frame)
        except OSError as failed:
            raise self._failed(failed) from failed
        self.frames += 1

    def _file_for(self, frame: Frame) -> Any:
        """Return the writer for *frame*, after setting a full file aside."""
        writer = self._writer
        if not isinstance(writer, can.SizedRotatingLogger):
            return writer
        if writer.should_rollover(message_of(frame)):
            writer.do_rollover()
            writer.rollover_count += 1
        return writer.writer

    @property
    def _open_file(self) -> Any:
        """Open the current file; returns its writer."""
        return self._writer.writer if isinstance(self._writer, can.SizedRotatingLogger) else self._writer

    def note(self, text: str, time_s: float) -> None:
        """Write *text* between frames, at *time_s* (s since 1970), if the format can (.asc)."""
        self._format.note(self._open_file, text, time_s)

    def flush(self) -> None:
        """Flush to the system, so that a kill loses nothing (.blf and .mf4 keep a block back)."""
        if self._format.flushes:
            try:
                self._open_file.file.flush()
            except OSError as failed:
                raise self._failed(failed) from failed

    @property
    def files(self) -> int:
        """How many files were written."""
        return 1 + int(getattr(self._writer, "rollover_count", 0))

    def close(self) -> None:
        """Write pending frames and close the file."""
        try:
            self._writer.stop()
        except OSError as failed:
            raise self._failed(failed) from failed

    def _failed(self, failed: OSError) -> DvtcliError:
        return DvtcliError(
            f"{self.path}: {failed.strerror or failed} after {self.frames} frames",
            hint="what was written before is in the file, the last frames may be missing",
            place=str(self.path),
        )

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _at: TracebackType | None
    ) -> None:
        try:
            self.close()
        except DvtcliError:
            if error is None:  # else what ended the recording is the news
                raise


def _cannot(path: Path, what: str, can_do: Callable[[RecordingFormat], bool]) -> UsageError:
    others = " ".join(suffix for suffix, file_format in written().items() if can_do(file_format))
    return UsageError(f"{path.name}: {what} in a {path.suffix} file", hint=f"take one of {others}")


def size_of(path: Path) -> int:
    """Return the file's size in bytes; 0 if absent."""
    return path.stat().st_size if path.exists() else 0
