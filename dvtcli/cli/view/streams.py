"""Detect streams without a reader, as opposed to full disks, and silence them."""

from __future__ import annotations

import errno
import os
import stat
import sys
from contextlib import suppress
from typing import TextIO

#: errors of a pipe or socket with a closed other end
_LEFT = frozenset({errno.EPIPE, errno.ECONNRESET, errno.ESHUTDOWN})


class ReaderLeft(Exception):
    """Whoever read an endless answer is gone; no OSError, since click ends the program at a broken pipe."""


def nobody_reads(stream: TextIO, failed: OSError) -> bool:
    """Whether *failed*, from writing to *stream*, means a lost reader or terminal."""
    if failed.errno in _LEFT:
        return True
    if sys.platform == "win32" and failed.errno == errno.EINVAL:  # what Windows says of a pipe whose reader is gone
        return not stream.isatty()
    return failed.errno == errno.EIO and _is_terminal(stream)


def _is_terminal(stream: TextIO) -> bool:
    """Whether *stream* is a terminal, even if already closed."""
    try:
        return stat.S_ISCHR(os.fstat(stream.fileno()).st_mode)
    except (OSError, ValueError):
        return False


def silence(stream: TextIO) -> None:
    """Discard buffered and future output of *stream*."""
    with suppress(OSError, ValueError):  # a stream without a file has nobody to leave
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def is_abandoned(stream: TextIO) -> bool:
    """Whether the reader of *stream* is gone, tested without writing."""
    import select

    if sys.platform == "win32":
        return True  # Windows: whoever asks has seen a broken pipe already
    with suppress(OSError, ValueError):
        poll = select.poll()
        poll.register(stream.fileno(), 0)
        return any(event & (select.POLLERR | select.POLLHUP | select.POLLNVAL) for _, event in poll.poll(0))
    return False


def open_missing() -> None:
    """Open null devices for missing stdin, stdout or stderr (`>&-`).

    Otherwise the first opened file or bus would get their number, and receive messages.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)  # the lowest free number, which is the missing stream's
            os.set_inheritable(nowhere, True)
            setattr(sys, name, open(nowhere, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
