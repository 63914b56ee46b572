"""Tcl at the prompt: single lines, or a mode in which every line is Tcl's. Does not know how a line is read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.cli.dvt.tcl_lines import LineEnd, TclLines
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.typed_tcl import TypedTcl


class TclMode:
    """Tcl for one *session*, with what its lines have set; *on* says whether typed lines are Tcl's."""

    def __init__(self, session: Conversation) -> None:
        self._session = session
        self._lines: TclLines | None = None
        #: lines of a command that is not whole yet
        self._pending = ""
        self.on = False

    @property
    def continues(self) -> bool:
        """Whether the next line goes on with the last one."""
        return bool(self._pending)

    def run(self, text: str) -> int:
        """Run a whole line; its exit code. UsageError where a brace, bracket or quote is not closed."""
        end = self._run(text)
        if end.open:
            raise UsageError("a brace, bracket or quote is not closed", hint="`tcl` alone takes Tcl of several lines")
        return end.code

    def typed(self, text: str) -> int:
        """Run a line that was typed in the mode, or keep it until it is whole; its exit code."""
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
        """Throw away the lines of a command that is not whole."""
        self._pending = ""

    def close(self) -> None:
        """End Tcl's process, and with it what the lines have set."""
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
                self._session.output.note("Tcl begins anew: variables and procedures are gone")


def tcl_of(session: Conversation) -> TypedTcl:
    """The session's Tcl; its process is started with the first line."""
    if session.tcl is None:
        session.tcl = TclMode(session)
    return session.tcl
