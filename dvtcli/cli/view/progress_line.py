"""Progress of long work on stderr: an updated line at a terminal, else a new line each 10 %.

Off a terminal no line is repeated, even if the work restarts, and lines are at least 5 s apart. Short work shows
nothing.
"""

from __future__ import annotations

import os
import time
from typing import TextIO

#: Time before progress is shown (s): at a terminal, and elsewhere.
TERMINAL_S, PIPE_S = 0.3, 5.0
_ERASE = "\r\x1b[K"


class ProgressLine:
    """Progress on *stream*, shown once the work took *terminal_s* or, off a terminal, *pipe_s* seconds."""

    def __init__(self, stream: TextIO, *, terminal_s: float = TERMINAL_S, pipe_s: float = PIPE_S) -> None:
        self._stream = stream
        self._terminal_s, self._pipe_s = terminal_s, pipe_s
        self._since_s: float | None = None
        self._tenth = 0
        self._said: set[str] = set()
        self._said_s = float("-inf")
        self._is_shown = False

    def show(self, text: str, done: int, total: int) -> None:
        """Show *text*, and *done* of *total* (0: unknown) parts."""
        now_s = time.monotonic()
        self._since_s = now_s if self._since_s is None else self._since_s
        is_terminal = self._stream.isatty() and os.environ.get("TERM") != "dumb"
        if now_s - self._since_s < (self._terminal_s if is_terminal else self._pipe_s):
            return
        try:
            if is_terminal:
                columns = os.get_terminal_size(self._stream.fileno()).columns or 80
                self._stream.write(f"{_ERASE}{text[: columns - 1]}")
                self._is_shown = True
            elif total and 10 * done // total != self._tenth:
                self._tenth = 10 * done // total
                self._say(text, now_s)
            self._stream.flush()
        except OSError:
            self._nobody_reads()

    def _say(self, text: str, now_s: float) -> None:
        """Write a new line."""
        if text not in self._said and now_s - self._said_s >= self._pipe_s:
            self._stream.write(f"{text}\n")
            self._said.add(text)
            self._said_s = now_s

    def erase(self) -> None:
        """Make room for something else; the work goes on."""
        if self._is_shown:
            self._is_shown = False
            try:
                self._stream.write(_ERASE)
                self._stream.flush()
            except OSError:
                self._nobody_reads()

    def _nobody_reads(self) -> None:
        from dvtcli.cli.view.streams import silence

        silence(self._stream)

    def end(self) -> None:
        """The work is done."""
        self.erase()
        self._since_s, self._tenth, self._said_s = None, 0, float("-inf")
        self._said.clear()
