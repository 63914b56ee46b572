"""Streams that nobody reads any more: told from those that are full, and made quiet.

Does not know what is written.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
from contextlib import suppress
from typing import TextIO

#: a pipe, or a socket, whose other end is closed
_LEFT = frozenset({errno.EPIPE, errno.ECONNRESET, errno.ESHUTDOWN})


class ReaderLeft(Exception):
    """Whoever read an endless answer is gone; no OSError, since click ends the program at a broken pipe."""


def nobody_reads(stream: TextIO, failed: OSError) -> bool:
    """Whether *failed*, which writing to *stream* ended with, says that its reader or its terminal is gone."""
    if failed.errno in _LEFT:
        return True
    if sys.platform == "win32" and failed.errno == errno.EINVAL:  # what Windows says of a pipe whose reader is gone
        return not stream.isatty()
    return failed.errno == errno.EIO and _is_terminal(stream)


def _is_terminal(stream: TextIO) -> bool:
    """Whether *stream* is a terminal, also one that is closed: that says no longer that it is one."""
    try:
        return stat.S_ISCHR(os.fstat(stream.fileno()).st_mode)
    except (OSError, ValueError):
        return False


def silence(stream: TextIO) -> None:
    """Send to nowhere what is written from now on, and what is still kept to be written."""
    with suppress(OSError, ValueError):  # a stream without a file has nobody to leave
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def is_abandoned(stream: TextIO) -> bool:
    """Whether the reader of *stream* is gone, asked without writing."""
    import select

    if sys.platform == "win32":
        return True  # Windows: whoever asks has seen a broken pipe already
    with suppress(OSError, ValueError):
        poll = select.poll()
        poll.register(stream.fileno(), 0)
        return any(event & (select.POLLERR | select.POLLHUP | select.POLLNVAL) for _, event in poll.poll(0))
    return False


def open_missing() -> None:
    """Give a program that was started without stdin, stdout or stderr (`>&-`) one that leads nowhere.

    Else the first file or bus that is opened gets its number, and messages would be written there.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)  # the lowest free number, which is the missing stream's
            os.set_inheritable(nowhere, True)
            setattr(sys, name, open(nowhere, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
