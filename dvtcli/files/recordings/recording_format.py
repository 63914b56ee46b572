"""What a format of recordings says of itself, and what it does where it is python-can's. Knows no bus and no PDO."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, NamedTuple

import can

from dvtcli.bus import can_message  # noqa: F401 - keeps python-can's log from stderr
from dvtcli.domain.ports import Frame


class RecordedFrame(NamedTuple):
    """One frame of a recording, with the name of the *channel* it came from; an *error* frame, or one of CAN *fd*."""

    frame: Frame
    channel: str = ""
    error: bool = False
    fd: bool = False


class RecordingFormat:
    """A format, found by the *suffix* of its files; *title* says in a word or two whose it is.

    It is read and written by python-can's reader and writer of that suffix; another one says here what reads and writes
    it: `reader`, `writer`. An instance of it stands in its file's `FORMATS`.
    """

    suffix: ClassVar[str]
    title: ClassVar[str]
    #: whether it is written, too
    is_written: ClassVar[bool] = True
    #: whether frames can be written behind those that a file has
    appends: ClassVar[bool] = False
    #: whether a recording can go on in another file (python-can's formats alone)
    rotates: ClassVar[bool] = False
    #: whether it holds remote frames
    keeps_remote: ClassVar[bool] = True
    #: whether the writer's *file* may be handed to the system at any time
    flushes: ClassVar[bool] = False
    #: whether what its reader raises says what is wrong, in words for users
    tells: ClassVar[bool] = False
    #: what its reader and writer raise at a file that is damaged or of another format
    broken: ClassVar[tuple[type[Exception], ...]] = (
        ValueError, LookupError, TypeError, AttributeError, NotImplementedError, ArithmeticError, EOFError,
        AssertionError, struct.error, zlib.error, can.CanError,
    )  # fmt: skip

    def __init_subclass__(cls) -> None:
        for said, example in (("suffix", ".asc"), ("title", "Vector ASCII")):
            if said not in vars(cls):
                raise TypeError(f'{cls.__module__}: {cls.__name__} lacks a line such as {said} = "{example}"')

    def require(self) -> None:
        """UsageError where a package is missing that it needs."""

    def source(self, _raw: BinaryIO, path: Path) -> Any:
        """What the reader takes, of the open file or of its path."""
        return str(path)

    def reader(self, source: Any) -> Iterator[can.Message | RecordedFrame]:
        """The frames of *source*, in its order: python-can's, or those that it made itself, which need no check."""
        return iter(can.LogReader(source))

    def writer(self, path: Path, *, append: bool, most_bytes: int) -> Any:
        """What writes to *path*: it has `on_message_received` and `stop`, and `file` where it `flushes`."""
        extra: dict[str, Any] = {"append": True} if append else {}
        return can.SizedRotatingLogger(path, most_bytes, **extra) if most_bytes else can.Logger(path, **extra)

    def write(self, writer: Any, message: can.Message) -> None:
        """Write *message* with *writer*."""
        writer.on_message_received(message)

    def note(self, writer: Any, text: str, time_s: float) -> None:
        """Say *text* between the frames, at *time_s* (s since 1970), where the format can."""
