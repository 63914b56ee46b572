"""Recordings of frames, in the formats that are written and read without loss. Knows no bus and no PDO."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import can
from can.io.blf import BLFParseError

from dvtcli.bus.can_message import frame_of
from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError, InputFileError, UsageError

#: Formats by suffix.
FORMATS = {
    ".asc": "Vector ASCII",
    ".blf": "Vector binary",
    ".log": "candump",
    ".mf4": "ASAM MDF, needs asammdf",
    ".pcapng": "Wireshark",
    ".trc": "PEAK",
}
#: Formats that are only read, by suffix.
ONLY_READ = {".pcap": "tcpdump"}
APPENDABLE = (".blf", ".log")
ROTATING = (".asc", ".blf", ".log")
_TEXT = (".asc", ".log", ".trc")
_CAPTURES = (".pcap", ".pcapng")
_FLUSHED = (*_TEXT, ".pcapng")
_REFUSED = {
    ".db": "the writer of .db files loses frames that are written shortly before its end",
    ".csv": "the frames' data would be base64, and the channel is lost; for values give --decode",
}
#: what python-can's readers raise at a file that is damaged or of another format
_BROKEN = (
    ValueError, LookupError, TypeError, AttributeError, NotImplementedError, struct.error, zlib.error, BLFParseError,
)  # fmt: skip
#: the times that frames may have, in seconds since 1970: those of the years 1653 to 5138
_FIRST_S, _LAST_S = -1e10, 1e11
_MOST_BYTES = 8
#: candump's CAN-IDs with the error flag (linux/can.h)
_ERROR_FRAME = re.compile(r" [2367][0-9A-F]{7}#", re.I)
#: what the writers leave out, by suffix
_NO_REMOTE = (".trc",)


def checked_suffix(path: Path, *, reading: bool = False) -> str:
    """The suffix of *path*; UsageError where no lossless format has it, or the package for it is missing."""
    suffix = path.suffix.lower()
    if suffix in _REFUSED and not reading:
        raise UsageError(f"{path.name}: {_REFUSED[suffix]}", hint=f"take one of {' '.join(FORMATS)}")
    if suffix in ONLY_READ and not reading:
        raise UsageError(f"{path.name}: {suffix} files are only read", hint=f"take one of {' '.join(FORMATS)}")
    known = FORMATS | ONLY_READ if reading else FORMATS
    if suffix not in known:
        raise UsageError(
            f"{path.name}: no format is known by {suffix or 'a name without a suffix'}",
            hint=", ".join(f"{one} ({what})" for one, what in known.items()),
        )
    if suffix == ".mf4":
        _need_asammdf()
    return suffix


def _need_asammdf() -> None:
    from importlib.util import find_spec

    if find_spec("asammdf") is None:
        raise UsageError(".mf4 files need asammdf", hint="pip install 'dvtcli[mdf]'")


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
        except _BROKEN as wrong:
            raise InputFileError(f"{path}: nothing can be appended to it", why=str(wrong), place=str(path)) from wrong

    def write(self, frame: Frame) -> None:
        """Write one frame; DvtcliError where the disk takes no more."""
        if frame.remote and self._suffix in _NO_REMOTE:
            self.left_out += 1
            return
        message = _message(frame)
        try:
            self._file_for(message).on_message_received(message)
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
        if self._suffix in _FLUSHED:
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
        dlc=len(frame.data),
        data=None if frame.remote else frame.data,
        channel="can0",
    )


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
                    count += 1
                channel = "" if message.channel is None else str(message.channel)
                fd = message.is_fd or len(message.data) > _MOST_BYTES
                yield Recorded(frame_of(message), channel, message.is_error_frame, fd)
        except (*_BROKEN, can.CanError) as wrong:
            raise _damaged(path, source, count, wrong) from wrong
    if not count:
        raise InputFileError(f"{path.name} holds no frame", hint=f"is it a {suffix} file?", place=str(path))


def _refuse_no_date(time_s: float) -> None:
    """ValueError for a time that no calendar has: neither from a recording's own start nor since 1970."""
    if not _FIRST_S <= time_s <= _LAST_S:
        raise ValueError(f"{time_s:g} s is no time of a frame")


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
    if suffix in _TEXT:
        kind = _CandumpLines if suffix == ".log" else _CountedLines
        return kind(raw, encoding="utf-8", errors="replace")
    return raw if suffix in (".blf", *_CAPTURES) else str(path)


def _reader(suffix: str, source: Any) -> Iterator[can.Message]:
    if suffix == ".asc":
        return iter(can.ASCReader(source, relative_timestamp=False))
    if suffix in _CAPTURES:
        from dvtcli.files.pcap import read_capture

        return read_capture(source)
    readers: dict[str, Any] = {".log": can.CanutilsLogReader, ".trc": can.TRCReader, ".blf": can.BLFReader}
    return iter(readers[suffix](source) if suffix in readers else can.LogReader(source))


def _damaged(path: Path, source: Any, count: int, wrong: Exception) -> InputFileError:
    line = getattr(source, "line", 0)
    why = str(wrong).partition("\n")[0] or type(wrong).__name__
    place = f"{path}:{line}" if line else str(path)
    return InputFileError(f"{place}: damaged after {count} frames, or no {path.suffix} file", why=why, place=place)


def size_of(path: Path) -> int:
    """The file's size in bytes; 0 where it is gone."""
    return path.stat().st_size if path.exists() else 0
