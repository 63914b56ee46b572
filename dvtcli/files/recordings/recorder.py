"""Write frames to a recording, in lossless formats only."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import can

from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.recordings.formats import format_of, written
from dvtcli.files.recordings.recording_format import RecordingFormat, message_of


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
