"""The terminal's streams: readers that left, missing streams, and input typed ahead."""

from __future__ import annotations

import errno
import os
import re
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


#: Keys without a letter, replies of the terminal, and the marks around what is pasted.
_SEQUENCE = re.compile("\x1b(?:\\[[0-9;?]*[ -/]*[@-~]|O.|.)?")
#: Backspace, as terminals send it
_ERASES = "\x7f\b"
#: Ctrl-U and Ctrl-C: the line is given up
_CLEARS = "\x15\x03"
#: longer text was not typed
LONGEST_TYPED = 4000


def typed_ahead(stream: TextIO) -> str:
    """Take the unread input of the terminal *stream*, without waiting for more; empty if it is not a terminal."""
    return _read_pending(stream) if stream.isatty() else ""


def as_lines(keys: str) -> str:
    """Return the lines that *keys* make, without the end of the last line and without keys that are no letters.

    Empty if they are longer than a person types: a part would be another line.
    """
    lines = [""]
    for key in _SEQUENCE.sub("", keys).replace("\r\n", "\n"):
        if key in "\r\n":
            lines.append("")
        elif key in _ERASES:
            lines[-1] = lines[-1][:-1]
        elif key in _CLEARS:
            lines[-1] = ""
        elif key == "\t":
            lines[-1] += " "
        elif key.isprintable():
            lines[-1] += key
    text = "\n".join(line for line in lines if line.strip())
    return text if len(text) <= LONGEST_TYPED else ""


def thrown_away(keys: str) -> str | None:
    """Return the message that *keys* were thrown away; None if there were none."""
    count = len(_SEQUENCE.sub("", keys))
    if not count:
        return None
    return f"{count} character{'s' * (count != 1)} typed in between {'was' if count == 1 else 'were'} discarded"


if sys.platform == "win32":

    def _read_pending(stream: TextIO) -> str:
        import msvcrt

        del stream
        text = ""
        while msvcrt.kbhit():
            key = msvcrt.getwch()
            if key in "\0\xe0":  # a key without a letter, which the next character names
                msvcrt.getwch()
            else:
                text += key
        return text

else:

    def _read_pending(stream: TextIO) -> str:
        """Take everything out of the terminal, a line that is not ended included."""
        import termios

        typed = b""
        descriptor = stream.fileno()
        with suppress(termios.error, OSError):  # a terminal that is closed has nothing more to give
            before = termios.tcgetattr(descriptor)
            at_once = termios.tcgetattr(descriptor)
            at_once[3] &= ~termios.ICANON
            at_once[6][termios.VMIN], at_once[6][termios.VTIME] = 0, 0
            termios.tcsetattr(descriptor, termios.TCSANOW, at_once)
            try:
                while data := os.read(descriptor, 65536):
                    typed += data
            finally:
                termios.tcsetattr(descriptor, termios.TCSANOW, before)
        return typed.decode("utf-8", "replace")
