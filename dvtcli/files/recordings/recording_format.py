"""The interface of a recording format, with python-can's reader and writer as defaults, and lines that they skip."""

from __future__ import annotations

import struct
import zlib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, NamedTuple

import can

from dvtcli.bus import can_message  # noqa: F401 - keeps python-can's log from stderr
from dvtcli.domain.ports import Frame
from dvtcli.domain.text import safe


class RecordedFrame(NamedTuple):
    """A frame of a recording with its *channel*; *error*: an error frame; *fd*: CAN FD."""

    frame: Frame
    channel: str = ""
    error: bool = False
    fd: bool = False


class RecordingFormat:
    """A format with the *suffix* of its files; *title* names its origin in a word or two.

    The defaults are python-can's reader and writer for the suffix; override `reader` and `writer` for others. `formats`
    has an instance of each format with a suffix of its own, `pasted.PASTED` of the others.
    """

    suffix: ClassVar[str]
    title: ClassVar[str]
    #: whether dvtcli writes the format
    is_written: ClassVar[bool] = True
    #: whether frames can be appended to a file
    appends: ClassVar[bool] = False
    #: whether a recording can continue in another file (python-can's formats only)
    rotates: ClassVar[bool] = False
    #: whether the format has remote frames
    keeps_remote: ClassVar[bool] = True
    #: whether the writer's *file* may be flushed at any time
    flushes: ClassVar[bool] = False
    #: whether the reader's errors have texts for users
    tells: ClassVar[bool] = False
    #: errors of reader and writer for a file that is damaged or of another format
    broken: ClassVar[tuple[type[Exception], ...]] = (
        ValueError, LookupError, TypeError, AttributeError, NotImplementedError, ArithmeticError, EOFError,
        AssertionError, struct.error, zlib.error, can.CanError,
    )  # fmt: skip

    def __init_subclass__(cls) -> None:
        for said, example in (("suffix", ".asc"), ("title", "Vector ASCII")):
            if not hasattr(cls, said):
                raise TypeError(f'{cls.__module__}: {cls.__name__} needs a line such as {said} = "{example}"')

    def require(self) -> None:
        """Raise UsageError if a required package is missing."""

    def source(self, _raw: BinaryIO, path: Path) -> Any:
        """Return the reader's input: the open file, or its path."""
        return str(path)

    def reader(self, source: Any) -> Iterator[can.Message | RecordedFrame]:
        """Iterate over frames of *source* in order: python-can's, or finished frames that need no check."""
        return iter(can.LogReader(source))

    def writer(self, path: Path, *, append: bool, most_bytes: int) -> Any:
        """Return a writer to *path* with `on_message_received` and `stop`, and `file` if the format `flushes`."""
        extra: dict[str, Any] = {"append": True} if append else {}
        return can.SizedRotatingLogger(path, most_bytes, **extra) if most_bytes else can.Logger(path, **extra)

    def write(self, writer: Any, frame: Frame) -> None:
        """Write *frame* with *writer*."""
        writer.on_message_received(message_of(frame))

    def note(self, writer: Any, text: str, time_s: float) -> None:
        """Write *text* between frames, at *time_s* (s since 1970), if the format can."""


def message_of(frame: Frame) -> can.Message:
    """Return *frame* as python-can's writers take it."""
    return can.Message(
        timestamp=frame.timestamp_s,
        arbitration_id=frame.can_id,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        dlc=frame.dlc if frame.remote else len(frame.data),
        data=None if frame.remote else frame.data,
        channel="can0",
    )


_LONGEST = 60


class NoFrameError(ValueError):
    """The data is not a possible frame."""


class LostLineError(NoFrameError):
    """The line with number *line* should be a frame but is not."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(no_frame(text))
        self.line = line


def no_frame(text: str) -> str:
    """Return the message that a line of a recording is not a frame, with the line."""
    shown = text.strip()[:_LONGEST]
    unprintable = sum(not character.isprintable() or character == "\N{REPLACEMENT CHARACTER}" for character in shown)
    if unprintable * 4 > len(shown):
        return "this line is not a frame, nor text"
    return f"this line is not a frame: {safe(shown)}"


#: maximum length of a line (characters), against files without line ends
MOST_CHARACTERS = 1 << 20


UTF_16 = "utf-16"


def encoding_of(head: bytes) -> str:
    """The encoding of a text that begins with *head*: UTF-16 by its byte order mark, as PowerShell's `>` writes it."""
    return UTF_16 if head.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig"


class CountedLines(TextIOWrapper):
    """A text file that knows the last line read; bytes that are no text become replacement characters."""

    line = 0
    text = ""

    def __init__(self, raw: BinaryIO) -> None:
        super().__init__(raw, encoding=encoding_of(raw.peek(2)), errors="replace")  # type: ignore[attr-defined]

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        """Return the next line, and count it."""
        text = super().readline(MOST_CHARACTERS if size < 0 else size)
        self.line += 1
        if len(text) == MOST_CHARACTERS and size < 0:
            raise LostLineError(self.line, text[:80])
        self.text = text
        return text

    def __next__(self) -> str:  # type: ignore[override]
        text = self.readline()
        if not text:
            raise StopIteration
        return text

    def lines(self) -> Iterator[tuple[int, str]]:
        """Iterate over the lines with their numbers, as `readline` returns them; faster than that."""
        readline = super().readline
        while text := readline(MOST_CHARACTERS):
            self.line += 1
            if len(text) == MOST_CHARACTERS:
                raise LostLineError(self.line, text[:80])
            self.text = text
            yield self.line, text


class LeftLines(CountedLines):
    """Lines for a reader that skips unknown lines: a skipped line is checked on reading the next."""

    #: whether the reader used the last line
    used = True
    begun = False

    def readline(self, size: int = -1, /) -> str:  # type: ignore[override]
        """Return the next line. Raises LostLineError if the reader skipped a damaged frame."""
        if not self.used and self.is_lost(self.text):
            raise LostLineError(self.line, self.text)
        self.used = False
        return super().readline(size)

    def took(self) -> None:
        """Record that the reader made a frame of the last line."""
        self.used = self.begun = True

    def is_lost(self, text: str) -> bool:
        """Whether *text*, skipped by the reader, should be a frame."""
        raise NotImplementedError
