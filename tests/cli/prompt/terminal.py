"""A real terminal for tests: a pseudo-terminal with dvtcli in it, and a screen that shows what a person would see."""

from __future__ import annotations

import os
import signal
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pexpect
import pyte
import pytest
from pexpect.fdpexpect import fdspawn

from tests import process
from tests.harness.forked import Forked
from tests.posix import NO_TERMINAL
from tests.process import environment as clean
from tests.process import start

#: How long a screen may take to show something, in seconds: generous, since a test never waits longer than needed.
PATIENCE_S = process.PATIENCE_S
#: a program that wrote nothing for so long (s) has drawn its screen
QUIET_S = 0.05
#: a screen that never rests, as a monitor's, is looked at between two drawings after this long (s)
RESTLESS_S = 1.0
#: a program whose cursor is hidden for so long (s) is in the middle of no drawing: it shows none at all
CURSORLESS_S = 5.0
#: how a line ends in which something may be typed: at a prompt, behind a backslash, at a question
ASKS = (">", "  ...", "[y/N]")

UP, DOWN, TAB, ENTER, ESCAPE = "\x1b[A", "\x1b[B", "\t", "\r", "\x1b"
CTRL_C, CTRL_D, CTRL_R, F1 = "\x03", "\x04", "\x12", "\x1bOP"


class Answering(pyte.Screen):
    """A screen that answers where its cursor is, as terminals do, unless it is told not to."""

    child: Child | pexpect.spawn[bytes]
    answers = True

    def write_process_input(self, data: str) -> None:
        if self.answers:
            self.child.send(data)


class Child(fdspawn):  # type: ignore[type-arg]
    """dvtcli at a terminal of *dimensions* (rows, columns); used as pexpect.spawn is."""

    def __init__(self, process: Callable[[Path], Forked], dimensions: tuple[int, int]) -> None:
        pytest.importorskip("fcntl", reason=NO_TERMINAL)
        master, self._other_end = os.openpty()
        super().__init__(master)
        self.setwinsize(*dimensions)
        self._process = process(Path(os.ttyname(self._other_end)))
        self.exitstatus: int | None = None

    def setwinsize(self, rows: int, columns: int) -> None:
        import fcntl
        import termios

        fcntl.ioctl(self.child_fd, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def eof(self) -> bool:
        return bool(self.flag_eof)

    def kill(self, number: int) -> None:
        self._process.send_signal(number)

    def read_nonblocking(self, size: int = 1, timeout: float | None = 0) -> bytes:
        """As pexpect's; here the terminal's other end is also ours, so that its end is that of the process."""
        ended = self._process.poll() is not None
        try:
            read: bytes = super().read_nonblocking(size, timeout)
            return read
        except pexpect.TIMEOUT:
            if ended:
                raise pexpect.EOF("dvtcli has ended") from None
            raise

    def close(self, force: bool = False) -> None:
        """Take the terminal away, and wait for the end; with *force* it does not take long."""
        if self.closed:
            return
        super().close()
        os.close(self._other_end)
        if force:
            self._process.kill()
        code = self._process.wait(PATIENCE_S)
        self.exitstatus = code if code >= 0 else None


class Terminal:
    """`python -m dvtcli` with *arguments* in a terminal of *columns* x *rows*."""

    def __init__(
        self,
        state: Path,
        *arguments: str,
        columns: int = 80,
        rows: int = 24,
        environment: dict[str, str] | None = None,
        command: list[str] | None = None,
    ) -> None:
        env = clean() | dict.fromkeys(("XDG_STATE_HOME", "LOCALAPPDATA", "HOME"), str(state))
        env |= environment or {}
        self.child: Child | pexpect.spawn[bytes]
        if command or process.FRESH_PYTHON:
            words = command or [sys.executable, "-m", "dvtcli", *arguments]
            self.child = pexpect.spawn(words[0], words[1:], env=env, dimensions=(rows, columns), cwd=str(state))
        else:
            self.child = Child(lambda tty: start(arguments, env=env, cwd=state, terminal=tty), (rows, columns))
        self.child.delaybeforesend = None
        self.screen = Answering(columns, rows)
        self.screen.child = self.child
        self._stream = pyte.ByteStream(self.screen)
        self.written = b""
        #: what `lines` gave; None where the screen has changed since
        self._lines: list[str] | None = None

    @property
    def lines(self) -> list[str]:
        """The screen's rows, without blanks at their ends."""
        if self._lines is None:
            self._lines = [self._row(number) for number in range(self.screen.lines)]
        return self._lines

    def _row(self, number: int) -> str:
        """One row of the screen: what was written to it; the right half of a wide character holds nothing."""
        cells = [" "] * self.screen.columns
        for column, cell in self.screen.buffer[number].items():
            cells[column] = cell.data
        return "".join(cells).rstrip()

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    @property
    def cursor_line(self) -> str:
        """The row the cursor is in: the line being typed."""
        return self.lines[self.screen.cursor.y]

    @property
    def toolbar(self) -> str:
        return self.lines[-1]

    def type(self, keys: str) -> None:
        self.child.send(keys)

    def run(self, line: str) -> None:
        """Type *line* where one is asked for, and Enter once it stands there.

        A person does not type faster than the terminal shows; what is typed while a command runs does not run.
        """
        self.until(lambda: self.cursor_line.endswith(ASKS), f"a place to type {line!r} at")
        self.type(line)
        self.until(lambda: line[-20:] in self.cursor_line, f"{line!r} on the line")
        self.type(ENTER)

    def resize(self, columns: int, rows: int) -> None:
        """Give the terminal another size between two drawings, as a terminal does that keeps what it is told in order.

        The program stands still meanwhile: what it drew for the old size is on the screen when that changes.
        """
        self.child.kill(signal.SIGSTOP)
        while self._read():
            pass
        self.screen.resize(rows, columns)
        self._lines = None
        self.child.setwinsize(rows, columns)
        self.child.kill(signal.SIGCONT)

    def wait(self, *texts: str) -> None:
        """Wait until the screen shows all of *texts* at once."""
        self.until(lambda: all(text in self.text for text in texts), " and ".join(map(repr, texts)))

    def row(self, *texts: str) -> str:
        """Wait until one row of the screen holds all of *texts*; that row, the first such."""

        def found() -> list[str]:
            return [line for line in self.lines if all(text in line for text in texts)]

        self.until(lambda: bool(found()), f"a row with {', '.join(map(repr, texts))}")
        return found()[0]

    def wait_prompt(self, prompt: str = "sim/1 PRE-OP> ") -> None:
        """Wait for an empty prompt under the cursor."""
        self.until(lambda: self.cursor_line == prompt.rstrip() and self.screen.cursor.x == len(prompt), f"{prompt!r}")

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Read what the program writes until *condition* holds on a screen at rest; AssertionError with it otherwise.

        A screen is drawn in pieces: what a test reads off it in the middle of a drawing is on no screen a person sees.
        """
        end_s = time.monotonic() + PATIENCE_S
        while True:
            if condition():
                self._rest()
                if condition():
                    return
            in_time = time.monotonic() < end_s and not self.child.eof()
            assert in_time, f"waited for {what}; the screen is:\n{self.text}"
            self._read()

    def ended(self) -> int | None:
        """Wait for the program's end; its exit code."""
        end_s = time.monotonic() + PATIENCE_S
        while not self.child.eof():
            assert time.monotonic() < end_s, f"dvtcli did not end; the screen is:\n{self.text}"
            self._read()
        self._close()
        return self.child.exitstatus

    def _rest(self) -> None:
        """Read until a drawing is complete: its cursor is shown again and nothing more comes."""
        began_s = time.monotonic()
        while not self.child.eof():
            comes, rested_s = self._read(), time.monotonic() - began_s
            if rested_s > CURSORLESS_S if self.screen.cursor.hidden else not comes or rested_s > RESTLESS_S:
                return

    def _read(self) -> bool:
        """Feed the screen what the program wrote; whether it wrote anything."""
        try:
            data = self.child.read_nonblocking(65536, timeout=QUIET_S)
        except pexpect.TIMEOUT:
            return False
        except pexpect.EOF:
            self.child.flag_eof = True
            return False
        self.written += data
        self._stream.feed(data)
        self._lines = None
        return True

    def close(self) -> None:
        self._close(force=True)

    def _close(self, *, force: bool = False) -> None:
        """Wait for the program's end, however long that takes; with *force* it is killed."""
        if isinstance(self.child, pexpect.spawn) and not self.child.closed:  # its own way gives it a tenth of a second
            if force and self.child.isalive():
                self.child.kill(signal.SIGKILL)
            self.child.wait()
        self.child.close(force=force)
