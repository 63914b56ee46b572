"""A run of Tcl in its own process, as seen by the parent: limits, served calls, and ends."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt.tcl_calls import TclCalls, modern
from dvtcli.cli.dvt.tcl_wire import Call, CallResult, End, Frame, Gone, Limits, Ready, Setup, WireError, receive, send
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.bounded_process import BoundedProcess, child_command

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

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
        self._ended_hint = "its earlier changes remain"
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
                error.state_text += "; earlier changes of the script stay"
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
            hint="; ".join(filter(None, [modern(end.message), self._ended_hint])),
        )  # fmt: skip

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
