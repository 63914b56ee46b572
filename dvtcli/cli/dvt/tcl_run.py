"""A run of Tcl in a process of its own, seen from ours: what it may take, what it calls, how it ends.

Does not know what may be called (`tcl_calls`), nor whether it runs a script (`tcl_script`) or lines (`tcl_lines`).
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt.tcl_calls import TclCalls, modern
from dvtcli.cli.dvt.tcl_process import Late, TclProcess
from dvtcli.cli.dvt.tcl_wire import Call, CallResult, End, Frame, Gone, Limits, Ready, Setup, WireError
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.errors import DvtcliError, InputFileError, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: What a script, or a line, may take by itself: time (its words' waiting not counted), Tcl commands, memory.
LIMITS = Limits(seconds=600.0, steps=100_000_000, memory_bytes=512 << 20)
#: Tcl looks after its time itself, to say where it was; where it cannot, its process is killed after so much (s) more.
_GRACE_S = 0.5
#: How long (s) the process may take to start and to look through the script.
START_S = 60.0
_MOST_OF_A_MESSAGE = 10_000


class TclRun:
    """One run of Tcl by *process*, named *source* in messages, whose *calls* are served, within *limits*.

    The process may take *start_s* to begin.
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
        self._ended_hint = "what it had set before stays set"
        self._endless_hint = "what its words have set stays set"
        #: where the last command of ours was called, None where none was
        self._last: str | None = None

    def _begin(self, path: str) -> Ready:
        """Let the process begin, with the script at *path*, or without one; DvtcliError where there is no Tcl."""
        setup = Setup(path, self._calls.served, *self._limits)
        late = DvtcliError(f"{self._source}: Tcl's process did not begin within {self._start_s:g} s")
        ready: Ready = self._heard(setup, self._start_s, late, Ready)
        if ready.missing:
            raise DvtcliError(
                "Tcl scripts need Python's tkinter, which is not installed",
                why=ready.missing,
                hint="install python3-tk (Debian, Ubuntu), python3-tkinter (Fedora) or python-tk (Homebrew); "
                ".dvt scripts need none",
            )
        return ready

    def _next(self, said: Frame) -> Call | End:
        """Let Tcl compute until it calls a command of ours or ends; what it waited for us is not counted.

        Nothing is written meanwhile: a signal need not wait for a safe point.
        """
        began = time.monotonic()
        try:
            left_s = self._limits.seconds - self._computed_s + _GRACE_S
            with self._session.cancellation.released():
                if self._session.cancellation.requested:  # asked for while the last command was under way
                    raise KeyboardInterrupt
                heard: Call | End = self._heard(said, left_s, self._endless(self._source), Call, End)
        finally:
            self._computed_s += time.monotonic() - began
        return heard

    def _heard(self, said: Frame, seconds: float, late: DvtcliError, *kinds: type[Any]) -> Any:
        """What Tcl's process answers; *late*, or its end before the script's as an error, whatever the reason."""
        try:
            return self._process.asked(said, seconds, *kinds)
        except Late:
            raise self._stopped(late) from None
        except WireError as wrong:
            raise self._stopped(
                DvtcliError(f"{self._source}: Tcl's process broke its protocol and was ended", why=str(wrong))
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
        """*error*, which ended the script and names its own place, with what is known of the devices."""
        self._session.place = None
        if self._last is not None:
            error.state = "unknown"
            error.state_text = "unchanged since its last command"
            if not self._session.staying():  # else its lines are named
                error.state_text += "; what the script set before stays set"
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
            return DvtcliError(f"{place}: Tcl's process ended the script in an unknown way", why=end.how[:40])
        return UsageError(
            f"{place}: {end.message[:_MOST_OF_A_MESSAGE]}", place=place,
            hint="; ".join(filter(None, [modern(end.message), self._ended_hint])),
        )  # fmt: skip

    def _answered(self, call: Call) -> CallResult:
        """Carry out a command of ours: its answer, or why not for an error that the script may catch."""
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
        """`FILE:LINE` as it is shown, of a path and a line that Tcl's process says."""
        del file, line
        return self._source
