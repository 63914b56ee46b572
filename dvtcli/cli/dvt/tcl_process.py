"""The process in which a Tcl script runs, seen from ours: started, asked in turn, killed when it is late.

Does not know what is asked, nor what the DVT's words are; takes nothing that comes from there for granted.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from dvtcli.cli.dvt.tcl_wire import NO_MEMORY, Frame, Gone, receive, send
from dvtcli.errors import DvtcliError
from dvtcli.interpreter import python_words

#: What the process runs; `sys.path` comes as arguments, so that it finds what we found, and nothing of this folder.
_BOOT = "import sys; sys.path[:] = sys.argv[1:]; from dvtcli.cli.dvt.tcl_child import main; main()"
#: How Tcl ends where there is no memory left, or a value would be longer than it can count.
_PANIC = re.compile("alloc|max size for a Tcl value|max length of a Tcl|MemoryError")
_WATCH_S = 0.05
#: what keeps a Ctrl-C from it on Windows; elsewhere its own session does
_OWN_GROUP: int = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
#: A process that has closed its pipe is about to end; one that does not in this time (s) is killed.
_END_S = 2.0
_MOST_SAID = 4_000


class Late(Exception):
    """It did not say anything in time, and was killed."""


def tcl_command() -> list[str]:
    """The words that start Tcl's process: this Python, isolated from environment and folder."""
    return [*python_words(), "-I", "-S", "-c", _BOOT, *map(os.path.abspath, sys.path)]


class TclProcess:
    """That process while the block runs; *command* starts it (another one in tests).

    It has no descriptor of ours but its own pipes, and no terminal: a Ctrl-C is ours to answer.
    """

    def __init__(self, command: Sequence[str] | None = None) -> None:
        self._process = _started(tcl_command() if command is None else command)
        self._late = False
        #: until when (monotonic s) something must have been said, while somebody waits for that
        self._until_s: float | None = None
        self._over = threading.Event()
        self._watch = threading.Thread(target=self._watched, name="tcl-watch", daemon=True)
        self._watch.start()

    def __enter__(self) -> TclProcess:
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

    def asked(self, frame: Frame, seconds: float, *kinds: type[Any]) -> Any:
        """Say *frame* and wait up to *seconds* for an answer of one of *kinds*.

        Raises Late where it did not come in time, Gone where the process ended, WireError for anything else.
        """
        assert self._process.stdin is not None  # noqa: S101 - for the type checker
        assert self._process.stdout is not None  # noqa: S101
        self._until_s = time.monotonic() + seconds
        try:
            send(self._process.stdin, frame)
            return receive(self._process.stdout, *kinds)
        except Gone as gone:
            raise (Late if self._late else Gone) from gone
        finally:
            self._until_s = None

    def _watched(self) -> None:
        """Kill the process where it is late; that ends a wait for it, be it for its pipe to empty."""
        while not self._over.wait(_WATCH_S):
            until_s = self._until_s
            if until_s is not None and time.monotonic() > until_s:
                self._late = True
                self._process.kill()
                return

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


def _started(command: Sequence[str]) -> subprocess.Popen[bytes]:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("DVTCLI_")}  # no passcode
    try:
        return subprocess.Popen(  # noqa: S603 - our own words
            command, env=environment, start_new_session=True, creationflags=_OWN_GROUP,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
    except OSError as failed:
        raise DvtcliError("the process for Tcl cannot be started", why=f"{command[0]}: {failed.strerror}") from failed


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
