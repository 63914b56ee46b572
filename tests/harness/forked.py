"""dvtcli in a process that is forked from one that has read its code already: a start costs a tenth of a Python's.

All else is as `python -m dvtcli` has it: process-ID, signals, environment, folder, umask, streams, exit code. Only what
the interpreter itself does at its start and end is not seen: that is `Fresh`'s.

Does not know what dvtcli is told to do.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from multiprocessing import connection
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import IO

#: what the process that the others are forked from reads; __main__ too, or each of them would read pytest's
_PRELOADED = ["__main__", "tests.harness.forked", "tests.harness.forked_from"]
#: a process's end is told once: multiprocessing is asked by one thread at a time, also by each start, which asks of all
_ONE_AT_A_TIME = threading.Lock()


@cache
def _context() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    return context


@dataclass(frozen=True)
class Start:
    """What a process is given at its start; *streams* are its three standard ones, or one terminal."""

    words: list[str]
    env: dict[str, str]
    cwd: Path
    streams: list[Path]
    umask: int


class Forked:
    """A running dvtcli, used as subprocess.Popen is.

    Its standard input comes from a text and its output goes into files, or it leads a session at *terminal*, a tty.
    With *pipes* its output goes into pipes instead, `stdout` and `stderr`, whose reader may leave.
    """

    stdout: IO[bytes]
    stderr: IO[bytes]

    def __init__(
        self,
        words: Sequence[str],
        *,
        env: Mapping[str, str],
        cwd: Path | None = None,
        stdin: str = "",
        merge: bool = False,
        umask: int = -1,
        terminal: Path | None = None,
        pipes: bool = False,
    ) -> None:
        self.args = ["dvtcli", *words]
        folder = tempfile.mkdtemp(prefix="dvtcli-streams-")
        self._remove = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._paths = [Path(folder) / name for name in ("in", "out", "out" if merge else "error")]
        for path in self._paths:
            path.write_text(stdin if path == self._paths[0] else "", encoding="utf-8")
        start = Start(list(words), dict(env), cwd or Path.cwd(), [terminal] if terminal else self._paths, umask)
        self._begin(start, pipes=pipes)

    def _begin(self, start: Start, *, pipes: bool) -> None:
        for path in self._paths[1:] if pipes else ():
            path.unlink()
            os.mkfifo(path)
        self._process = _context().Process(target=_be_dvtcli, args=(start,), daemon=True)
        with _ONE_AT_A_TIME:
            self._process.start()
        assert self._process.pid is not None
        self.pid = self._process.pid
        if pipes:  # each open waits for the other side's
            self.stdout, self.stderr = (path.open("rb") for path in self._paths[1:])

    def poll(self) -> int | None:
        """Its exit code, a signal's number below 0, or None while it runs."""
        with _ONE_AT_A_TIME:
            return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end for *timeout* seconds, else subprocess.TimeoutExpired; its exit code."""
        connection.wait([self._process.sentinel], timeout)
        if self.poll() is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0)
        return self.returncode

    @property
    def returncode(self) -> int:
        """The exit code of a process that has ended."""
        code = self.poll()
        assert code is not None, "it runs"
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(getattr(signal, "SIGKILL", signal.SIGTERM))  # on Windows each ends it at once

    def so_far(self) -> tuple[str, str]:
        """What it wrote so far to standard output and to standard error."""
        out, error = (path.read_text("utf-8") for path in self._paths[1:])
        return out, error

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Wait for its end; what it wrote to standard output and to standard error, once."""
        self.wait(timeout)
        if not self._remove.alive:
            return "", ""
        out, error = (path.read_text("utf-8") for path in self._paths[1:])
        self._remove()
        return out, "" if self._paths[1] == self._paths[2] else error


class Fresh(Forked):
    """The same in a Python of its own, or the program that the variable TESTS_PROGRAM names: a frozen one."""

    def _begin(self, start: Start, *, pipes: bool) -> None:
        apart = subprocess.STDOUT if self._paths[1] == self._paths[2] else subprocess.PIPE
        with self._paths[0].open() as stdin, self._paths[1].open("a") as stdout, self._paths[2].open("a") as stderr:
            self._child = subprocess.Popen(
                [*program_words(), *start.words], stdin=stdin,
                stdout=subprocess.PIPE if pipes else stdout, stderr=apart if pipes else stderr,
                env=start.env, cwd=start.cwd, umask=start.umask,
            )  # fmt: skip
        self.pid = self._child.pid
        if self._child.stdout is not None:
            self.stdout, self.stderr = self._child.stdout, self._child.stderr or self._child.stdout

    def poll(self) -> int | None:
        return self._child.poll()

    def wait(self, timeout: float | None = None) -> int:
        return self._child.wait(timeout)


def program_words() -> list[str]:
    """The command line that starts dvtcli, without its own words."""
    program = os.environ.get("TESTS_PROGRAM")
    return [program] if program else [sys.executable, "-m", "dvtcli"]


def _be_dvtcli(start: Start) -> None:
    """In the new process: take on all that a process is given at its start, and run dvtcli."""
    os.environ.clear()
    os.environ.update(start.env)
    time.tzset()
    tempfile.tempdir = None
    os.chdir(start.cwd)
    if start.umask >= 0:
        os.umask(start.umask)
    _take_streams(start.streams)
    sys.argv = ["dvtcli", *start.words]
    if any(name.startswith("PYTEST_MUTATION_") for name in os.environ):
        from tests.benchmarks.mutation_lines import in_started_process

        in_started_process()
    from dvtcli.__main__ import entry

    entry()


def _take_streams(streams: list[Path]) -> None:
    at_terminal = len(streams) == 1
    if at_terminal:
        os.setsid()
    for number, path in enumerate(streams * 3 if at_terminal else streams):
        opened = os.open(path, os.O_RDWR if at_terminal else os.O_WRONLY | os.O_APPEND if number else os.O_RDONLY)
        os.dup2(opened, number)
        os.close(opened)
    if at_terminal:
        import fcntl
        import termios

        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    opened_streams = {
        "stdin": open(0, encoding="utf-8", closefd=False),  # noqa: SIM115 - to the process's end
        "stdout": open(1, "w", encoding="utf-8", closefd=False),  # noqa: SIM115
        "stderr": open(2, "w", 1, "utf-8", "backslashreplace", closefd=False),  # noqa: SIM115
    }
    for name, stream in opened_streams.items():
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
