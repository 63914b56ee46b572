"""Run work with unbounded cost in a child process with limits of time and memory.

The child is isolated from the environment and the terminal. It is killed if it is late, and at the end of the parent's
block. Treat its output as untrusted.
"""

from __future__ import annotations

import io
import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING, Self

from dvtcli.errors import DvtcliError
from dvtcli.files.bounded_child import NO_MEMORY
from dvtcli.interpreter import python_words

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

#: `sys.path` is passed as arguments: the child imports the same modules, and nothing from its folder.
_BOOT = "import sys; sys.path[:] = sys.argv[1:]; from {} import main; main()"
#: final messages of Tcl and Python for lack of memory, or a value too long for Tcl
_PANIC = re.compile("alloc|max size for a Tcl value|max length of a Tcl|MemoryError")
_WATCH_S = 0.05
_OUT_OF_CPU_TIME: int = getattr(signal, "SIGXCPU", 0) or 1 << 16
#: keeps Ctrl-C away on Windows; elsewhere the child's own session does
_OWN_GROUP: int = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
#: A process with a closed pipe is about to end; it is killed after this time (s).
_END_S = 2.0
_MOST_SAID = 4_000
#: Python runs a signal's handler between two waits (s): a signal just before a read would wait for the read's end.
_WAIT_S = 0.1


def child_command(module: str) -> list[str]:
    """Return the command line for `main` of *module* in this Python, isolated from environment and folder."""
    return [*python_words(), "-I", "-S", "-c", _BOOT.format(module), *map(os.path.abspath, sys.path)]


class BoundedProcess:
    """A child process that lives as long as the block; *command* starts it, for *purpose*.

    The child inherits no descriptor but its own pipes, and no terminal: the parent handles Ctrl-C.
    """

    def __init__(self, command: Sequence[str], purpose: str) -> None:
        self._process = _started(command, purpose)
        assert self._process.stdout is not None  # noqa: S101 - for the type checker
        #: the pipe from the process's output; a signal's handler runs while it is read
        self.stdout = io.BufferedReader(_WaitedFor(self._process.stdout))
        self.is_late = False
        #: deadline (monotonic s) for an awaited answer, None if none is awaited
        self._until_s: float | None = None
        self._over = threading.Event()
        self._watch = threading.Thread(target=self._watched, name="child-watch", daemon=True)
        self._watch.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Kill the process in any state."""
        self._over.set()
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self.stdout, self._process.stderr):
            assert stream is not None  # noqa: S101 - for the type checker
            with suppress(OSError):  # what could not be written is for nobody any more
                stream.close()
        self._watch.join()

    @property
    def stdin(self) -> IO[bytes]:
        """The pipe to the process's input."""
        assert self._process.stdin is not None  # noqa: S101 - for the type checker
        return self._process.stdin

    @contextmanager
    def within(self, seconds: float) -> Iterator[None]:
        """Kill the process if the block takes longer than *seconds*, and set `is_late`."""
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
        """Whether the ended process ran out of time or CPU time."""
        return self.is_late or self._process.returncode == -_OUT_OF_CPU_TIME

    def last_words(self) -> tuple[bool, str]:
        """For a process that ended by itself: whether it ran out of memory, and how it ended."""
        try:
            code = self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        assert self._process.stderr is not None  # noqa: S101 - for the type checker
        said = self._process.stderr.read(_MOST_SAID).decode("utf-8", "replace").strip()
        how = f"it ended with {code}" if code >= 0 else f"it was killed by {_signal_name(-code)}"
        return code == NO_MEMORY or _PANIC.search(said) is not None, f"{how}: {said}" if said else how


class _WaitedFor(io.RawIOBase):
    """*pipe*, read only once it has data or has ended, so that a signal is obeyed while nothing comes."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe = pipe

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Wait for data, and read what fits into *buffer*; 0 at the end."""
        # On Windows a pipe cannot be waited for so, and a signal waits for the read.
        while sys.platform != "win32" and not select.select([self._pipe], [], [], _WAIT_S)[0]:
            pass
        with memoryview(buffer).cast("B") as view:
            data = os.read(self._pipe.fileno(), len(view))
            view[: len(data)] = data
        return len(data)

    def close(self) -> None:
        """Close the pipe."""
        self._pipe.close()
        super().close()


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
