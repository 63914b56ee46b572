"""The parent process as seen by a Tcl script's process: asked over a pipe; both end together.

Imports only its neighbour of dvtcli for the wire.
"""

from __future__ import annotations

import os
import threading
from queue import SimpleQueue
from typing import IO

from dvtcli.cli.dvt.tcl_wire import (
    Call,
    CallResult,
    End,
    Go,
    Gone,
    Ready,
    Setup,
    TclLine,
    WireError,
    receive,
    send,
)

#: For the thread that waits for answers: the usual 8 MiB would count as the script's memory.
_STACK_BYTES = 1 << 18


class Parent:
    """The process that owns the bus; if it ends, this process ends at once."""

    def __init__(self) -> None:
        self._answers, self._calls = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1):  # Tcl has channels of its own for these
            os.dup2(nothing, stream)
        os.close(nothing)
        self._received: SimpleQueue[Setup | Go | TclLine | CallResult] = SimpleQueue()
        threading.stack_size(_STACK_BYTES)
        threading.Thread(target=_hear, args=(self._answers, self._received), daemon=True).start()

    def told(self) -> Setup | Go | TclLine | CallResult:
        """Wait for the parent's next message."""
        return self._received.get()

    def asked(self, call: Call) -> CallResult:
        """Return the parent's answer to *call*."""
        self.tell(call)
        answer = self.told()
        assert isinstance(answer, CallResult)  # noqa: S101 - calls and answers take turns
        return answer

    def tell(self, frame: Ready | Call | End) -> None:
        """Say something."""
        send(self._calls, frame)


def _hear(answers: IO[bytes], received: SimpleQueue[Setup | Go | TclLine | CallResult]) -> None:
    try:
        while True:
            received.put(receive(answers, Setup, Go, TclLine, CallResult))
    except (Gone, WireError, MemoryError):
        os._exit(1)
