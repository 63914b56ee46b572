"""Tcl at the prompt: single lines, or a mode for Tcl lines only."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.cli.dvt.tcl_calls import Ended, TclCalls
from dvtcli.cli.dvt.tcl_run import LIMITS, TclProcess, TclRun
from dvtcli.cli.dvt.tcl_safe import Exit
from dvtcli.cli.dvt.tcl_wire import Call, CallResult, Frame, Limits, TclLine
from dvtcli.errors import DvtcliError, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation, TypedTcl


_OVER = CallResult(True, "the line ended at the previous command")


class LineEnd(NamedTuple):
    """The end of a line: exit *code*; *open*: more lines must follow; whether it called `exit`."""

    code: int = 0
    open: bool = False
    leaves: bool = False


class TclLines(TclRun):
    """Tcl with the state of all lines so far, until `close`; started by the first line, and after a crash."""

    def __init__(self, session: Conversation, limits: Limits = LIMITS) -> None:
        self._calls = TclCalls(session, "tcl", Path.cwd())
        self._began = False
        super().__init__(session, "tcl", TclProcess(), self._calls, limits)
        #: whether Tcl waits for a line; false if stopped from outside during a line
        self.waits = True
        #: the first error or exit of the current line; all later calls are refused
        self._end: Ended | Exit | DvtcliError | None = None

    def close(self) -> None:
        """End Tcl's process, and discard its variables."""
        self._process.__exit__()

    def line(self, text: str) -> LineEnd:
        """Run *text* and print its result. Raises a word's errors, UsageError if Tcl refuses the line."""
        self._computed_s, self._last, self._end, self.waits = 0.0, None, None, False
        self._calls.failures.clear()
        if not self._began:
            self._begin("")
            self._began = True
        said: Frame = TclLine(text)
        try:
            while isinstance(received := self._next(said), Call):
                said = self._served(received)
        finally:
            self._calls.flush()
        self.waits = True
        match self._end:
            case Exit(code=code):
                return LineEnd(code, leaves=True)
            case Ended(code=code):
                return LineEnd(code)
            case DvtcliError():
                raise self._end
        if received.how == "open":
            return LineEnd(open=True)
        if received.how != "done":
            raise self._placed(self._failure(received, self._source))
        if received.message:
            self._session.output.said(received.message.splitlines(), error=False)
        return LineEnd(self._calls.failures[0][1].exit_code if self._calls.failures else 0)

    def _served(self, call: Call) -> CallResult:
        """Answer a call; if the call ends the line, refuse this and all later calls."""
        if self._end is None:
            try:
                return self._answered(call)
            except (Ended, Exit, DvtcliError) as ended:
                self._end = ended
        return _OVER


class TclMode:
    """Tcl for a *session*, with its variables; *on*: typed lines are Tcl."""

    def __init__(self, session: Conversation) -> None:
        self._session = session
        self._lines: TclLines | None = None
        #: lines of an incomplete command
        self._pending = ""
        self.on = False

    @property
    def continues(self) -> bool:
        """Whether the next line continues the last."""
        return bool(self._pending)

    def run(self, text: str) -> int:
        """Run a whole line; returns its exit code. Raises UsageError for an open brace, bracket or quote."""
        end = self._run(text)
        if end.open:
            raise UsageError("a brace, bracket or quote is not closed", hint="`tcl` alone takes Tcl of several lines")
        return end.code

    def typed(self, text: str) -> int:
        """Run a line typed in the mode, or keep it until complete; returns its exit code."""
        whole = self._pending + text
        self._pending = ""
        end = self._run(whole)
        if end.open:
            self._pending = whole + "\n"
        if end.leaves:
            self.on = False
        return end.code

    def leave(self) -> None:
        """Leave the mode, and throw away what is not whole; the variables stay."""
        self.on, self._pending = False, ""

    def forget(self) -> None:
        """Discard the lines of an incomplete command."""
        self._pending = ""

    def close(self) -> None:
        """End Tcl's process, and discard its variables."""
        if self._lines is not None:
            self._lines.close()
            self._lines = None

    def _run(self, text: str) -> LineEnd:
        if self._lines is None:
            self._lines = TclLines(self._session)
        try:
            return self._lines.line(text)
        finally:
            if not self._lines.waits:  # it was stopped from outside, or is gone
                self.close()
                self._session.output.note("Tcl was restarted: its variables and procedures are lost")


def tcl_of(session: Conversation) -> TypedTcl:
    """Return the session's Tcl; the first line starts its process."""
    if session.tcl is None:
        session.tcl = TclMode(session)
    return session.tcl
