"""A process of ours that may take so much time and memory: what nobody can bound from within runs in it.

Started isolated from the environment and the terminal, killed when it is late and with its parent's block. Does not
know what it does; takes nothing that comes from there for granted.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Self

from dvtcli.errors import DvtcliError
from dvtcli.files.bounded_child import NO_MEMORY
from dvtcli.interpreter import python_words

#: `sys.path` comes as arguments, so that it finds what we found, and nothing of this folder.
_BOOT = "import sys; sys.path[:] = sys.argv[1:]; from {} import main; main()"
#: how Tcl ends if there is no memory left or a value would be longer than it can count, and Python
_PANIC = re.compile("alloc|max size for a Tcl value|max length of a Tcl|MemoryError")
_WATCH_S = 0.05
_OUT_OF_CPU_TIME: int = getattr(signal, "SIGXCPU", 0) or 1 << 16
#: what keeps a Ctrl-C from it on Windows; elsewhere its own session does
_OWN_GROUP: int = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
#: A process that has closed its pipe is about to end; one that does not in this time (s) is killed.
_END_S = 2.0
_MOST_SAID = 4_000


def child_command(module: str) -> list[str]:
    """The words that start `main` of *module*: this Python, isolated from environment and folder."""
    return [*python_words(), "-I", "-S", "-c", _BOOT.format(module), *map(os.path.abspath, sys.path)]


class BoundedProcess:
    """That process while the block runs; *command* starts it, for *purpose*.

    It has no descriptor of ours but its own pipes, and no terminal: a Ctrl-C is ours to answer.
    """

    def __init__(self, command: Sequence[str], purpose: str) -> None:
        self._process = _started(command, purpose)
        self.is_late = False
        #: until when (monotonic s) something must have been said, while somebody waits for that
        self._until_s: float | None = None
        self._over = threading.Event()
        self._watch = threading.Thread(target=self._watched, name="child-watch", daemon=True)
        self._watch.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Kill it, whatever it does."""
        self._over.set()
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            assert stream is not None  # noqa: S101 - for the type checker
            with suppress(OSError):  # what could not be written is for nobody any more
                stream.close()
        self._watch.join()

    @property
    def stdin(self) -> IO[bytes]:
        """What it reads."""
        assert self._process.stdin is not None  # noqa: S101 - for the type checker
        return self._process.stdin

    @property
    def stdout(self) -> IO[bytes]:
        """What it says."""
        assert self._process.stdout is not None  # noqa: S101 - for the type checker
        return self._process.stdout

    @contextmanager
    def within(self, seconds: float) -> Iterator[None]:
        """Kill it if the block takes longer than *seconds*: that ends a wait for it; it `is_late` then."""
        self._until_s = time.monotonic() + seconds
        try:
            yield
        finally:
            self._until_s = None

    def _watched(self) -> None:
        while not self._over.wait(_WATCH_S):
            until_s = self._until_s
            if until_s is not None and time.monotonic() > until_s:
                self.is_late = True
                self._process.kill()
                return

    @property
    def lacked_time(self) -> bool:
        """Of a process that has ended: whether that was because of its time, or its CPU time."""
        return self.is_late or self._process.returncode == -_OUT_OF_CPU_TIME

    def last_words(self) -> tuple[bool, str]:
        """Of a process that ended by itself: whether it had no memory left; how it ended."""
        try:
            code = self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        assert self._process.stderr is not None  # noqa: S101 - for the type checker
        said = self._process.stderr.read(_MOST_SAID).decode("utf-8", "replace").strip()
        how = f"it ended with {code}" if code >= 0 else f"it was killed by {_signal_name(-code)}"
        return code == NO_MEMORY or _PANIC.search(said) is not None, f"{how}: {said}" if said else how


def _started(command: Sequence[str], purpose: str) -> subprocess.Popen[bytes]:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("DVTCLI_")}  # no passcode
    try:
        return subprocess.Popen(  # noqa: S603 - our own words
            command, env=environment, start_new_session=True, creationflags=_OWN_GROUP,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
    except OSError as failed:
        raise DvtcliError(
            f"the process for {purpose} cannot be started", why=f"{command[0]}: {failed.strerror}"
        ) from failed


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
