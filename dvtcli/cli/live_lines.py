"""Answer a program's lines as they arrive: `--json`, and a pipe on stdin that stays open.

Lines that arrive together form a script: parsed whole, run inside one NMT gate, stopped by the first failure. While
waiting for more, the bus is read.
"""

from __future__ import annotations

import os
import select
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING

from dvtcli.cli.boundary import SIGNALLED, exit_code_of
from dvtcli.cli.scripts.script import run_script, worst
from dvtcli.cli.scripts.script_parse import MOST_BYTES
from dvtcli.errors import BusUnavailable, InputFileError, LeftChanged

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.view.output import Output
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

#: Size of a pipe: if so much arrives at once, more follows within this time (s).
_FULL, _MORE_S = 65_536, 0.2
#: Duration of a read of the bus (s).
_TICK_S = 0.1
_SOURCE = "<stdin>"


def is_a_program(output: Output) -> bool:
    """Whether a program may be waiting for each answer at the other end of stdin; not for a file."""
    if not output.json:
        return False
    kind = os.fstat(sys.stdin.fileno()).st_mode
    return stat.S_ISFIFO(kind) or stat.S_ISSOCK(kind)


def answer_lines(session: Conversation) -> int:
    """Answer lines until stdin ends or `exit`; returns the first failure's exit code, or 7.

    A `require` that fails ends the input with its own code: no later line runs.
    """
    session.started = True
    codes, number = [], 1
    with _listening(session):
        for lines in chunks(session, sys.stdin.fileno()):
            code = exit_code_of(session, lambda: _run(session, lines, number))  # noqa: B023 - called at once
            number += lines.count(b"\n")
            codes += [code] if code else []
            if session.requirement_failed:
                return LeftChanged.exit_code if LeftChanged.exit_code in codes else code
            if session.left or code in SIGNALLED:
                break
    return worst(codes)


def _run(session: Conversation, lines: bytes, number: int) -> int:
    return run_script(session, lines, _SOURCE, keep_going=False, first_line=number)


def chunks(session: SessionUser, file: int) -> Iterator[bytes]:
    """Iterate over whole lines of the descriptor *file* as they arrive, lines waiting together in one chunk."""
    pending = b""
    while data := _waiting(session, file):
        pending += data
        if len(pending) > MOST_BYTES:
            raise InputFileError(f"{_SOURCE}: {len(pending)} bytes are too many for a line", place=_SOURCE)
        end = pending.rfind(b"\n") + 1
        if end and not pending[:end].rstrip(b"\r\n").endswith(b"\\"):
            yield pending[:end]
            pending = pending[end:]
    if pending:
        yield pending


def _waiting(session: SessionUser, file: int) -> bytes:
    """Wait for data in the pipe, and return it; empty at its end."""
    with session.cancellation.released():
        if session.cancellation.requested:  # a signal that came when the last line was complete already
            raise KeyboardInterrupt
        data = found = os.read(file, _FULL)
        while len(found) == _FULL and _comes(file):
            found = os.read(file, _FULL)
            data += found
    return data


def _comes(file: int) -> bool:
    """Whether more data is available, or arrives at once."""
    return os.name == "posix" and bool(select.select((file,), (), (), _MORE_S)[0])


@contextmanager
def _listening(session: SessionUser) -> Iterator[None]:
    """Read the bus during the block even without requests: heartbeats, boot-ups and EMCY count."""
    stopping = Event()
    thread = Thread(target=_listen, args=(session, stopping), name="listening", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join(1.0)


def _listen(session: SessionNodes, stopping: Event) -> None:
    while not stopping.is_set():
        if not session.is_open:
            stopping.wait(_TICK_S)
            continue
        try:
            session.wire.idle(_TICK_S)
        except BusUnavailable:  # the next line says so
            stopping.wait(_TICK_S)
