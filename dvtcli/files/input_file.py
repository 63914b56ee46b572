"""Read untrusted files safely: endless files, pipes and devices cannot hang the program."""

from __future__ import annotations

import json
import os
import stat
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from dvtcli.errors import InputFileError

#: How long a command waits for the first bytes of all its pipes (seconds): with its start it takes less than 10 then.
#: After its first byte a pipe may take as long as it likes.
FIRST_BYTE_S = 8.0


@dataclass(eq=False, repr=False)
class _Pipes:
    """Cached contents of pipes, by device and inode: a command may open a pipe's name twice."""

    read: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: time spent waiting for first bytes (s)
    waited_s: float = 0.0


_pipes = _Pipes()
#: maximum bytes of a pipe kept for further opens
_MOST_FROM_PIPE = 64 << 20


def read_input(path: Path | str, most_bytes: int, kind: str) -> bytes:
    """Read the whole of *path*, expected to be a *kind*, such as "network file".

    Raises OSError if unreadable, InputFileError if larger than *most_bytes*, a device, or a silent pipe.
    """
    data = _head(path, most_bytes + 1)
    if len(data) > most_bytes:
        raise InputFileError(f"{path} is larger than {_size(most_bytes)}", place=str(path), why=f"no {kind} is")
    return data


def read_input_head(path: Path | str, count: int) -> bytes:
    """Read up to *count* bytes from the beginning of *path*, of any size; raises as `read_input`."""
    return _head(path, count)[:count]


def json_line(line: str | bytes, place: str, text: str) -> Any:
    """Parse the JSON document in *line*; *place* is `FILE:LINE`.

    Raises InputFileError with *text* and the column if malformed.
    """
    try:
        return json.loads(line)
    except json.JSONDecodeError as wrong:
        raise InputFileError(text, place=f"{place}:{wrong.colno}", why=f"not JSON: {wrong.msg}") from wrong
    except UnicodeDecodeError as wrong:
        raise InputFileError(text, place=f"{place}:{wrong.start + 1}", why="not JSON: not UTF-8") from wrong
    except (ValueError, RecursionError) as wrong:
        raise InputFileError(text, place=place, why=f"not JSON: {wrong}") from wrong


def open_input(path: Path | str) -> BinaryIO:
    """Open *path* to be read as a stream, as recordings are, which have no largest size; raises as `read_input`."""
    return os.fdopen(_opened(path), "rb")


def forget_pipes() -> None:
    """Read pipes anew from now on: the command that read them has ended."""
    _pipes.read.clear()
    _pipes.waited_s = 0.0


def _size(count: int) -> str:
    return f"{count >> 20} MiB" if count >= 1 << 20 else f"{count >> 10} KiB"


def _head(path: Path | str, count: int) -> bytes:
    descriptor = _open_without_waiting(path)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISFIFO(status.st_mode):
            return file.read(count)
        pipe = status.st_dev, status.st_ino
        if pipe in _pipes.read:
            return _pipes.read[pipe]
        _wait_for_first_byte(path, descriptor)
        _pipes.read[pipe] = file.read(max(count, _MOST_FROM_PIPE))
        return _pipes.read[pipe]


def _opened(path: Path | str) -> int:
    """Open *path* for ordinary blocking reads; returns the descriptor."""
    descriptor = _open_without_waiting(path)
    try:
        if stat.S_ISFIFO(os.fstat(descriptor).st_mode):
            _wait_for_first_byte(path, descriptor)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _open_without_waiting(path: Path | str) -> int:
    """Open *path*. Raises InputFileError if it is neither a file nor a pipe."""
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    descriptor = os.open(path, flags)
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode) or stat.S_ISFIFO(mode) or (stat.S_ISCHR(mode) and Path(path).samefile(os.devnull)):
        return descriptor
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(21, "Is a directory", str(path))
    raise InputFileError(f"{path} is a device, not a file", place=str(path), hint="name a file or a pipe")


def _wait_for_first_byte(path: Path | str, descriptor: int) -> None:
    """Wait until the pipe has data or its writer has closed it."""
    if sys.platform == "win32":
        return  # no path there leads to a pipe that is opened without waiting
    import select

    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    begun_s = time.monotonic()
    has_come = poll.poll(max(FIRST_BYTE_S - _pipes.waited_s, 0) * 1000)
    _pipes.waited_s += time.monotonic() - begun_s
    if not has_come:
        raise InputFileError(
            f"{path}: no data from this pipe", place=str(path),
            why=f"a command waits {FIRST_BYTE_S:g} s for the first bytes of its pipes",
            hint="start the program that writes into it, or give a file",
        )  # fmt: skip
    os.set_blocking(descriptor, True)
