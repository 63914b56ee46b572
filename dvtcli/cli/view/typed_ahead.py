"""Discard and count input typed before a question; for terminals of POSIX and Windows."""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from typing import TextIO

#: A terminal's reply to the prompt's query of the cursor position, not typed by the user.
_ANSWERED = re.compile("\x1b\\[[0-9;]*R")


def throw_away(stream: TextIO, read_already: int = 0) -> str | None:
    """Discard unread input of the terminal *stream*; returns a message with its amount, None for none.

    *read_already* is the number of characters discarded elsewhere.
    """
    count = read_already + (_thrown_away(stream) if stream.isatty() else 0)
    if not count:
        return None
    return f"{count} character{'s' * (count != 1)} typed meanwhile {'was' if count == 1 else 'were'} thrown away"


if sys.platform == "win32":

    def _thrown_away(stream: TextIO) -> int:
        import msvcrt

        del stream
        count = 0
        while msvcrt.kbhit():
            msvcrt.getwch()
            count += 1
        return count

else:

    def _thrown_away(stream: TextIO) -> int:
        """Take everything out of the terminal, a line that is not ended included, without waiting for more."""
        import os
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
        return len(_ANSWERED.sub("", typed.decode("utf-8", "replace")))
