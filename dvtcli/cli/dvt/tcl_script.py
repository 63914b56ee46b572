"""Run Tcl scripts in a process of their own, in Tcl's safe mode, and serve the DVT's words."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.cli.dvt.tcl_calls import Ended, TclCalls
from dvtcli.cli.dvt.tcl_run import LIMITS, START_S, TclProcess, TclRun
from dvtcli.cli.dvt.tcl_safe import Exit
from dvtcli.cli.dvt.tcl_wire import Call, End, Frame, Go, Limits
from dvtcli.cli.scripts.script import enclosed, refuse_own_run
from dvtcli.cli.scripts.script_parse import script_text
from dvtcli.errors import UsageError, ended_with

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

_MOST_OF_A_PATH = 4096


def run_tcl(
    session: Conversation,
    data: bytes,
    source: str,
    *,
    keep_going: bool,
    most_seconds: float | None,
    limits: Limits = LIMITS,
) -> int:
    """Run the Tcl script *source* with content *data* inside one NMT gate; returns its exit code.

    *limits* apply, with *most_seconds* as the time if given. Raises DvtcliError if Python has no Tcl, UsageError or
    InputFileError with FILE:LINE for a malformed script.
    """
    if keep_going:
        raise UsageError(
            "--keep-going is for .dvt scripts: a Tcl script continues after an abort anyway, and can check the answers"
        )
    refuse_own_run(session, source)
    if not Path(source).is_file():  # Tcl reads it itself: a pipe would be empty by then
        raise UsageError(f"{source}: a Tcl script is a file", place=source)
    script_text(data, source)
    if most_seconds is not None:
        limits = limits._replace(seconds=most_seconds)
    with TclProcess() as process:
        script = TclScript(session, source, process, limits)
        script.check()
        session.started = True
        return enclosed(session, source, script.run)


class TclScript(TclRun):
    """A run of the Tcl script at *source* by *process*, which has *start_s* to begin, within *limits*."""

    def __init__(
        self, session: Conversation, source: str, process: TclProcess, limits: Limits, start_s: float = START_S
    ) -> None:
        self._path = Path(source).resolve()
        super().__init__(session, source, process, TclCalls(session, source, self._path.parent), limits, start_s)
        self._ended_hint = f"the script ended at this line; {self._ended_hint}"
        self._endless_hint += "; run --max-seconds N allows more time"

    def check(self) -> None:
        """Raise UsageError with the line of an unterminated command, DvtcliError if Python has no Tcl."""
        if line := self._begin(str(self._path)).unclosed:
            place = f"{self._source}:{line}"
            raise UsageError(f"{place}: a brace, bracket or quote opened here is not closed", place=place)

    def run(self) -> int:
        """Run the script; returns its exit code. Raises a word's errors other than Abort and Timeout."""
        said: Frame = Go()
        try:
            while isinstance(received := self._next(said), Call):
                said = self._answered(received)
        except (Ended, Exit) as ended:
            return ended.code
        finally:
            self._calls.flush()
        return self._outcome(received)

    def _outcome(self, end: End) -> int:
        if end.how == "done":
            return self._verdict()
        raise self._placed(self._failure(end, self._place(end.file, end.line)))

    def _verdict(self) -> int:
        """Return 0, or the code of the first failed word that the script did not accept; for documents, raise it."""
        if not self._calls.failures:
            return 0
        place, first = self._calls.failures[0]
        count = len(self._calls.failures)
        words = f"{count} word{' was' if count == 1 else 's were'} refused"
        text = f"{words}, first at {place} ({first.word}: {first.answer})"
        hint = "if this is intended, end the script with `exit 0`"
        if self._session.output.json:
            raise self._placed(ended_with(first.exit_code, text, hint=hint))
        self._session.output.warning(f"{text}; {hint}")
        return first.exit_code

    def _place(self, file: str, line: int) -> str:
        """Return `FILE:LINE` for display from the process's path and line."""
        if not file or not line or len(file) > _MOST_OF_A_PATH:
            return self._source
        shown = self._source if file == str(self._path) else Path(file).name
        return f"{shown}:{line}"
