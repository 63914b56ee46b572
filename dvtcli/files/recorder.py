"""Frames written into a recording, in the formats that take them without loss. Knows no bus and no PDO."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any

import can

from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.recording_formats import APPENDABLE, BROKEN, FLUSHED, NO_REMOTE, ROTATING, checked_suffix


class Recorder:
    """Writes frames to *path*; with *append* behind what is there, with *most_bytes* > 0 into a file after the other.

    UsageError where the format cannot do that or the file cannot be made. Use it in a `with`.
    """

    def __init__(self, path: Path, *, append: bool = False, most_bytes: int = 0) -> None:
        self.path = path
        self._suffix = checked_suffix(path)
        _refuse(append and self._suffix not in APPENDABLE, path, "nothing can be appended", APPENDABLE)
        _refuse(bool(most_bytes) and self._suffix not in ROTATING, path, "files cannot be rotated", ROTATING)
        self.frames = 0
        #: frames that the format cannot hold
        self.left_out = 0
        try:
            self._writer: Any = _writer(path, self._suffix, append=append, most_bytes=most_bytes)
        except OSError as failed:
            raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
        except BROKEN as wrong:
            raise InputFileError(f"{path}: nothing can be appended to it", why=str(wrong), place=str(path)) from wrong

    def write(self, frame: Frame) -> None:
        """Write one frame; DvtcliError where the disk takes no more."""
        if frame.remote and self._suffix in NO_REMOTE:
            self.left_out += 1
            return
        message = _message(frame)
        try:
            _write(self._file_for(message), message)
        except OSError as failed:
            raise self._failed(failed) from failed
        self.frames += 1

    def _file_for(self, message: can.Message) -> Any:
        """The writer of the file that *message* goes to; a full file is put aside.

        An .asc file's times count from the beginning in its head, whose milliseconds python-can writes without leading
        zeros (.001 becomes .1): it begins at a whole second.
        """
        writer = self._writer
        if isinstance(writer, can.SizedRotatingLogger):
            if writer.should_rollover(message):
                writer.do_rollover()
                writer.rollover_count += 1
            writer = writer.writer
        if isinstance(writer, can.ASCWriter) and not writer.header_written:
            writer.log_event("Start of measurement", float(int(message.timestamp)))
        return writer

    def note(self, text: str, time_s: float) -> None:
        """Say *text* between the frames, at *time_s* (s since 1970), where the format can (.asc)."""
        writer: Any = self._writer.writer if isinstance(self._writer, can.SizedRotatingLogger) else self._writer
        if isinstance(writer, can.ASCWriter) and writer.header_written:
            writer.log_event(text, time_s)

    def flush(self) -> None:
        """Hand what was written to the system, so that a kill loses nothing of it (.blf and .mf4 keep a block back)."""
        writer: Any = self._writer.writer if isinstance(self._writer, can.SizedRotatingLogger) else self._writer
        if self._suffix in FLUSHED:
            try:
                writer.file.flush()
            except OSError as failed:
                raise self._failed(failed) from failed

    @property
    def files(self) -> int:
        """How many files were written."""
        return 1 + int(getattr(self._writer, "rollover_count", 0))

    def close(self) -> None:
        """Write what waits and close the file."""
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


def _writer(path: Path, suffix: str, *, append: bool, most_bytes: int) -> Any:
    if suffix == ".pcapng":
        from dvtcli.files.pcap import PcapngWriter

        return PcapngWriter(path)
    extra: dict[str, Any] = {"append": True} if append else {}
    return can.SizedRotatingLogger(path, most_bytes, **extra) if most_bytes else can.Logger(path, **extra)


def _refuse(condition: bool, path: Path, what: str, formats: tuple[str, ...]) -> None:
    if condition:
        raise UsageError(f"{path.name}: {what} in a {path.suffix} file", hint=f"take one of {' '.join(formats)}")


def _message(frame: Frame) -> can.Message:
    return can.Message(
        timestamp=frame.timestamp_s,
        arbitration_id=frame.can_id,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        dlc=frame.dlc if frame.remote else len(frame.data),
        data=None if frame.remote else frame.data,
        channel="can0",
    )


def _write(writer: Any, message: can.Message) -> None:
    """Write *message*; python-can's candump leaves out how many bytes a remote frame asks for."""
    if isinstance(writer, can.CanutilsLogWriter) and message.is_remote_frame and message.dlc:
        can_id = f"{message.arbitration_id:0{8 if message.is_extended_id else 3}X}"
        writer.file.write(f"({message.timestamp:f}) {message.channel} {can_id}#R{message.dlc} R\n")
    else:
        writer.on_message_received(message)


def size_of(path: Path) -> int:
    """The file's size in bytes; 0 where it is gone."""
    return path.stat().st_size if path.exists() else 0
