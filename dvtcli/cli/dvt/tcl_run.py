"""Run Tcl in a process of its own, as seen by its parent: scripts, and lines of the prompt."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from dvtcli.cli.dvt.tcl_calls import Ended, Exit, TclCalls, file_as_command, modern
from dvtcli.cli.dvt.tcl_wire import (
    Call,
    CallResult,
    End,
    Frame,
    Go,
    Gone,
    Limits,
    Ready,
    Setup,
    TclLine,
    WireError,
    receive,
    send,
)
from dvtcli.cli.scripts.script import enclosed, refuse_own_run
from dvtcli.cli.scripts.script_parse import decoded_script
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DvtcliError, InputFileError, UsageError, ended_with
from dvtcli.files.bounded_process import BoundedProcess, child_command

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation, TypedTcl

#: What a script, or a line, may take by itself: time (its words' waiting not counted), Tcl commands, memory.
LIMITS = Limits(seconds=600.0, steps=100_000_000, memory_bytes=512 << 20)
#: Tcl looks after its time itself, to say where it was; where it cannot, its process is killed after so much (s) more.
_GRACE_S = 0.5
#: Time to start the process and to check the script (s).
START_S = 60.0
_MOST_OF_A_MESSAGE = 10_000


class TclRun:
    """A run of Tcl by *process*, named *source* in messages; serves *calls* within *limits*.

    The process has *start_s* to begin.
    """

    def __init__(
        self,
        session: Conversation,
        source: str,
        process: TclProcess,
        calls: TclCalls,
        limits: Limits = LIMITS,
        start_s: float = START_S,
    ) -> None:
        self._session, self._source, self._process, self._calls = session, source, process, calls
        self._limits, self._start_s = limits, start_s
        self._computed_s = 0.0
        #: the end of a script in words, empty for a line
        self._ended = ""
        self._endless_hint = "the changes of its commands remain"
        #: the place of the last served call, None if none
        self._last: str | None = None

    def _begin(self, path: str) -> Ready:
        """Start the process, with the script at *path* if any. Raises DvtcliError if Python has no Tcl."""
        setup = Setup(path, self._calls.served, *self._limits)
        late = DvtcliError(f"{self._source}: the Tcl process did not start within {self._start_s:g} s")
        ready: Ready = self._received(setup, self._start_s, late, Ready)
        if ready.missing:
            raise DvtcliError(
                "Tcl scripts need Python's tkinter, which is not installed",
                why=ready.missing,
                hint="install python3-tk (Debian, Ubuntu), python3-tkinter (Fedora) or python-tk (Homebrew); "
                ".dvt scripts need none",
            )
        return ready

    def _next(self, said: Frame) -> Call | End:
        """Let Tcl compute until its next call or end; time spent in calls does not count.

        Nothing is written meanwhile, so a signal need not wait for a safe point.
        """
        began = time.monotonic()
        try:
            left_s = self._limits.seconds - self._computed_s + _GRACE_S
            with self._session.cancellation.released():
                if self._session.cancellation.requested:  # asked for while the last command was under way
                    raise KeyboardInterrupt
                received: Call | End = self._received(said, left_s, self._endless(self._source), Call, End)
        finally:
            self._computed_s += time.monotonic() - began
        return received

    def _received(self, said: Frame, seconds: float, late: DvtcliError, *kinds: type[Any]) -> Any:
        """Return the process's answer. Raises *late*, or an error if the process ends before the script."""
        try:
            return self._process.asked(said, seconds, *kinds)
        except Late:
            raise self._stopped(late) from None
        except WireError as wrong:
            raise self._stopped(
                DvtcliError(f"{self._source}: the Tcl process violated its protocol and was ended", why=str(wrong))
            ) from wrong
        except Gone:
            raise self._stopped(self._gone()) from None

    def _gone(self) -> DvtcliError:
        no_memory, how = self._process.last_words()
        if no_memory:
            return self._too_big(self._source, how)
        return DvtcliError(f"{self._source}: Tcl's process ended before the script did", why=how)

    def _too_big(self, place: str, why: str) -> InputFileError:
        most = self._limits.memory_bytes >> 20
        return InputFileError(f"{place}: stopped: it needs more than {most} MiB of memory", place=place, why=why)

    def _stopped(self, error: DvtcliError) -> DvtcliError:
        """*error*, which ended the script from outside, with how far the script came."""
        if self._last is not None:
            error.details.insert(0, ("last", f"the last command of dvtcli was called at {self._last}"))
        return self._placed(error)

    def _placed(self, error: DvtcliError) -> DvtcliError:
        """Add the devices' known state to *error*, which ended the script and has its own place."""
        self._session.place = None
        if self._last is not None:
            error.state = "unknown"
            error.state_text = "unchanged since its last command"
            if not self._session.staying():  # else its lines are named
                error.state_text += "; what its earlier commands did stays"
        return error

    def _endless(self, place: str) -> InputFileError:
        return InputFileError(
            f"{place}: stopped after {self._limits.seconds:g} s of computing: it seems to run without end",
            place=place, hint=self._endless_hint,
        )  # fmt: skip

    def _failure(self, end: End, place: str) -> DvtcliError:
        if end.how == "seconds":
            return self._endless(place)
        if end.how == "steps":
            return InputFileError(f"{place}: stopped after {self._limits.steps} Tcl commands", place=place)
        if end.how == "memory":
            return self._too_big(place, end.message)
        if end.how != "failed":
            return DvtcliError(f"{place}: the Tcl process ended the script for an unknown reason", why=end.how[:40])
        return UsageError(
            f"{place}: {end.message[:_MOST_OF_A_MESSAGE]}", place=place,
            hint=self._hint(end.message),
        )  # fmt: skip

    def _hint(self, message: str) -> Hint | str | None:
        """What to do after the error *message*, and what remains of the script if it called dvtcli."""
        said = [self._ended, "what its earlier commands did stays" if self._last is not None else ""]
        rest = "; ".join(filter(None, said))
        if file := file_as_command(message):
            runs = Hint(Action.RUN, {"file": file}, "{} runs a file")
            return runs + f"; {rest}" if rest else runs
        return "; ".join(filter(None, [modern(message), rest])) or None

    def _answered(self, call: Call) -> CallResult:
        """Run a served command; returns its answer, or the reason for an error that the script may catch."""
        self._session.place = self._last = place = self._place(call.file, call.line)
        try:
            return CallResult(False, self._calls.run(call.name, call.texts, place))
        except UsageError as wrong:
            hint = "" if not wrong.hint else self._session.output.hints(wrong.node).text(wrong.hint)
            return CallResult(True, "; ".join(filter(None, (error_text(wrong), hint))))
        finally:
            if self._session.script_changes is not None:
                self._session.script_changes.note(place)

    def _place(self, file: str, line: int) -> str:
        """Return `FILE:LINE` for display from the process's path and line."""
        del file, line
        return self._source


class Late(Exception):
    """The process did not answer in time, and was killed."""


class TclProcess(BoundedProcess):
    """The process as long as the block runs; *command* starts it (a substitute in tests)."""

    def __init__(self, command: Sequence[str] | None = None) -> None:
        super().__init__(child_command("dvtcli.cli.dvt.tcl_child") if command is None else command, "Tcl")

    def asked(self, frame: Frame, seconds: float, *kinds: type[Any]) -> Any:
        """Send *frame* and wait up to *seconds* for an answer of *kinds*.

        Raises Late on timeout, Gone if the process ended, WireError for any other answer.
        """
        try:
            with self.within(seconds):
                send(self.stdin, frame)
                return receive(self.stdout, *kinds)
        except Gone as gone:
            raise (Late if self.is_late else Gone) from gone


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
    decoded_script(data, source)
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
        self._ended = "the script ended at this line"
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
