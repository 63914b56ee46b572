"""Where every failure ends: as a message and an exit code. Only `__main__` calls `sys.exit` with it."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from dvtcli.device.cancellation import INTERRUPTED
from dvtcli.errors import (
    BusUnavailable,
    DeviceRefused,
    DvtcliError,
    Interrupted,
    LeftChanged,
    NoAnswer,
    SdoAborted,
    SdoProtocolError,
)

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: The result of `exit`, which stops readers of lines; never an exit code of the process.
LEAVE = -1
#: The variable set by a shell for completion.
COMPLETING = "_DVTCLI_COMPLETE"
#: Exit codes of SIGHUP, SIGINT, SIGTERM.
SIGNALLED = frozenset({129, 130, 143})
#: Errors for which `trace last` shows details in frames, at the prompt or as a run of its own.
_OF_FRAMES = (SdoAborted, DeviceRefused, NoAnswer, SdoProtocolError, LeftChanged)
#: Errors after which nodes are not read again: the user waits, or no node answers.
_UNREAD = (BusUnavailable, Interrupted, NoAnswer, SdoProtocolError)
#: Error numbers of writing only: full disk, file size limit, lost terminal.
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})


def exit_code_of(session: Conversation, run: Callable[[], Any]) -> int:
    """Call *run*; returns the exit code of its result, or shows its error and returns the error's code."""
    try:
        result = run()
    except BaseException as raised:  # noqa: BLE001 - the one boundary
        with session.cancellation.deferred():
            return _ended(session, raised)
    finally:
        with session.cancellation.deferred():
            session.reset_output()
    return result if isinstance(result, int) else 0


def finish_line(session: Conversation, code: int, *, alone: bool = False) -> int:
    """End a line that ran with *code*; returns *code*, or if 0 that of an error of the line's end.

    The order: signals wait (`Conversation.line`); the command's error is shown, with its own output options; these are
    reset after warnings (`reset_output`); here, nodes return to their NMT states and are released (`Session.end_line`);
    the same follows for an error of that. Each error is shown; the first one decides the exit code.
    """
    ended = exit_code_of(session, lambda: session.end_line(code, alone=alone))
    return code or ended


def _ended(session: Conversation, raised: BaseException) -> int:
    """Show *raised*; returns its exit code."""
    if isinstance(raised, click.exceptions.Exit):
        return raised.exit_code
    from dvtcli.cli.view.streams import ReaderLeft, silence

    match raised:
        case DvtcliError():
            return _shown(session, raised)
        case click.ClickException():
            from dvtcli.cli.usage_errors import usage_error

            return _shown(session, usage_error(raised))
        case KeyboardInterrupt() | click.Abort():
            return _stopped(session)
        case ReaderLeft():
            return 0
        case BrokenPipeError() | SystemExit() if _only_the_reader_left(raised):
            silence(sys.stdout)
            return 0
        case OSError() if raised.errno in _NO_ROOM:
            from dvtcli.cli.crash import report_lost_results

            return report_lost_results(session, raised)
        case _:
            from dvtcli.cli.crash import bug_error, last_exchange

            return _shown(session, bug_error(raised, last_exchange(session), is_open=session.is_open))


def _shown(session: Conversation, error: DvtcliError) -> int:
    error.stays, error.only_looked = session.staying(), session.only_looks
    if error.stays and not isinstance(error, _UNREAD):
        error.stays_differing = session.stays_differing()
    if session.is_open and isinstance(error, _OF_FRAMES):
        error.traced_by = _traced_by(session)
    place = None if error.at_start else session.place
    try:
        session.output.error(error, place)
    except OSError:  # stdout takes no documents
        session.output.error(error, place, readable=True)
    return error.exit_code


def _traced_by(session: Conversation) -> str:
    """Return the command to show the last frames; keeps them for the next run if this run ends."""
    if session.at_prompt:
        return "trace last"
    from dvtcli.cli.crash import last_exchange
    from dvtcli.operations.frames.last_exchange import keep_exchange

    return "dvtcli trace last" if keep_exchange(last_exchange(session)) else ""


def _stopped(session: Conversation) -> int:
    """Report a signal, the changes left by a script and, for changes and comparisons, the nodes' state."""
    from dvtcli.domain.text import join_some

    code, staying = session.cancellation.exit_code, session.staying()
    word = "interrupted" if code == INTERRUPTED else "terminated"
    if session.tells_state or session.output.json:
        state, said = session.state_now()
        stopped = session.cancellation.interrupted(word, state=state)
        stopped.state_text = said
        return _shown(session, stopped)
    left = f": the changes of {join_some(staying)} stay" if staying else ""
    session.output.lines([word + left])
    return code


def _only_the_reader_left(raised: BrokenPipeError | SystemExit) -> bool:
    """Whether *raised* comes from a closed stdout pipe, or from click's completion, and not from a driver."""
    if isinstance(raised, SystemExit):
        return COMPLETING in os.environ
    from dvtcli.cli.view.streams import is_abandoned

    return is_abandoned(sys.stdout)
