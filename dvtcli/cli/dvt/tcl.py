"""Tcl scripts: run by a process of their own in Tcl's safe mode, with the DVT's words served from here.

Does not know what the words do (`words`), nor what a script may do besides them (`tcl_safe`), nor Tcl (`tcl_child`).
"""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.dvt.answers import answer
from dvtcli.cli.dvt.tcl_process import Late, TclProcess
from dvtcli.cli.dvt.tcl_safe import Commands, Exit, refuse_beyond_nodes
from dvtcli.cli.dvt.tcl_wire import Answer, Call, End, Frame, Go, Gone, Limits, Ready, Setup, WireError
from dvtcli.cli.dvt.word import Word
from dvtcli.cli.dvt.words import WORDS
from dvtcli.cli.run_line import run_words
from dvtcli.cli.script import enclosed, refuse_own_run, script_text
from dvtcli.errors import DvtcliError, InputFileError, UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import DvtAnswer

#: What a script may take by itself: 600 s, what its words wait for devices not counted; Tcl commands; memory.
LIMITS = Limits(seconds=600.0, steps=100_000_000, memory_bytes=512 << 20)
#: Tcl looks after its time itself, to say where it was; where it cannot, its process is killed after so much (s) more.
_GRACE_S = 0.5
#: How long (s) the process may take to start and to look through the script.
_START_S = 60.0
_NO_COMMAND = re.compile(r'invalid command name "(\w+)"')
_MOST_OF_A_PATH = 4096
_MOST_OF_A_MESSAGE = 10_000


class _Ended(Exception):
    """A command inside a script failed and was shown; *code* is its exit code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


def run_tcl(
    session: Conversation,
    data: bytes,
    source: str,
    *,
    keep_going: bool,
    most_seconds: float | None,
    limits: Limits = LIMITS,
) -> int:
    """Run the Tcl script *source*, whose content is *data*, inside one NMT gate; its exit code.

    It stays within *limits*, with *most_seconds* for theirs. Raises DvtcliError where Python has no Tcl, UsageError or
    InputFileError with FILE:LINE for a script that is none.
    """
    if keep_going:
        raise UsageError(
            "--keep-going is for .dvt scripts: a Tcl script runs on after an Abort by itself, and looks at the answers"
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


class TclScript:
    """One run of the Tcl script at *source* by *process*, which may take *start_s* to begin, within *limits*."""

    def __init__(
        self, session: Conversation, source: str, process: TclProcess, limits: Limits, start_s: float = _START_S
    ) -> None:
        self._session, self._source, self._process, self._limits = session, source, process, limits
        self._start_s = start_s
        self._path = Path(source).resolve()
        self._commands = Commands(session, self._path.parent)
        self._served = {
            *(name for name, word in WORDS.items() if word.run is not None),
            "dvtcli",
            *self._commands.names,
        }
        self._failures: list[tuple[str, DvtAnswer]] = []
        self._computed_s = 0.0
        #: where the last command of ours was called, None where none was
        self._last: str | None = None

    def check(self) -> None:
        """Raise UsageError with the line where a command begins that never ends, DvtcliError where there is no Tcl."""
        setup = Setup(str(self._path), tuple(sorted(self._served)), *self._limits)
        late = DvtcliError(f"{self._source}: Tcl's process did not begin within {self._start_s:g} s")
        ready = self._heard(setup, self._start_s, late, Ready)
        if ready.missing:
            raise DvtcliError(
                "Tcl scripts need Python's tkinter, which is not installed",
                why=ready.missing,
                hint="install python3-tk (Debian, Ubuntu), python3-tkinter (Fedora) or python-tk (Homebrew); "
                ".dvt scripts need none",
            )
        if ready.unclosed:
            place = f"{self._source}:{ready.unclosed}"
            raise UsageError(f"{place}: a brace, bracket or quote that begins here is not closed", place=place)

    def run(self) -> int:
        """Run it to its end; its exit code. Raises what a word raised that is neither Abort nor Timeout."""
        said: Frame = Go()
        try:
            while isinstance(heard := self._next(said), Call):
                said = self._answered(heard)
        except (_Ended, Exit) as ended:
            return ended.code
        finally:
            self._commands.flush()
        return self._outcome(heard)

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
            place=place, hint="what its words have set stays set; run --max-seconds N gives it more",
        )  # fmt: skip

    def _outcome(self, end: End) -> int:
        if end.how == "done":
            return self._verdict()
        raise self._placed(self._failure(end, self._place(end.file, end.line)))

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
            hint=f"{_modern(end.message)}the script ended at this line; what it had set before stays set",
        )  # fmt: skip

    def _verdict(self) -> int:
        """0, or the first failed word's code: nobody said that the failure was meant."""
        if not self._failures:
            return 0
        place, first = self._failures[0]
        count = len(self._failures)
        self._session.output.warning(
            f"{count} word{' was' if count == 1 else 's were'} refused, first at {place} ({first.word}: "
            f"{first.answer}); where that is meant, end the script with `exit 0`"
        )
        return first.exit_code

    def _answered(self, call: Call) -> Answer:
        """Carry out a command of ours: its answer, or why not for an error that the script may catch."""
        self._session.place = self._last = place = self._place(call.file, call.line)
        try:
            return Answer(False, self._run(call.name, call.texts))
        except UsageError as wrong:
            return Answer(True, f"{wrong.text}; {wrong.hint}" if wrong.hint else wrong.text)
        finally:
            if self._session.script_changes is not None:
                self._session.script_changes.note(place)

    def _run(self, name: str, texts: tuple[str, ...]) -> str:
        if name == "dvtcli":
            refuse_beyond_nodes(texts, self._session)
            code = run_words(texts, self._session)
            if code:
                raise _Ended(code)
            return "OK"
        if name in self._commands.names:
            return self._commands.run(name, texts)
        if name not in self._served:
            raise DvtcliError(f"{self._source}: Tcl's process asked for {name[:40]!r}, which is not served")
        return self._word(WORDS[name], texts)

    def _word(self, word: Word, texts: tuple[str, ...]) -> str:
        try:
            values = word.bind(texts)
        except ValueError as wrong:
            raise UsageError(f"{word.name}: {wrong}") from wrong
        said = answer(word, self._session, values)
        place, output = self._session.place or self._source, self._session.output
        if output.json:
            output.result(said)
        for finding in said.findings:
            output.note(f"{place}: {finding.text}")
        if said.exit_code:
            self._failures.append((place, said))
            output.note(f"{place}: {word.name} answered {said.answer}: {said.reasons[0]}")
        return said.answer

    def _place(self, file: str, line: int) -> str:
        """`FILE:LINE` as it is shown, of a path and a line that Tcl's process says."""
        if not file or not line or len(file) > _MOST_OF_A_PATH:
            return self._source
        shown = self._source if file == str(self._path) else Path(file).name
        return f"{shown}:{line}"


def _modern(message: str) -> str:
    """How a command of dvtcli is called in Tcl, where Tcl's *message* is that it has none of that name."""
    found = _NO_COMMAND.fullmatch(message)
    return f"in a Tcl script it is `dvtcli {found[1]} …`; " if found and found[1] in command_names() else ""
