"""Tcl scripts: run by the standard library's interpreter in safe mode, with the DVT's words as its commands.

Does not know what the words do (`words`), nor what the interpreter may do besides them (`tcl_safe`).
"""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.dvt.answers import answer
from dvtcli.dvt.tcl_interp import BRIDGE, SAFE, BareInterpreter, bare_interpreter
from dvtcli.dvt.tcl_safe import Commands, refuse_beyond_nodes
from dvtcli.dvt.words import WORDS, Word
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.script import enclosed, refuse_own_run, script_text
from dvtcli.shell import command_names, run_words

if TYPE_CHECKING:
    from dvtcli.results import DvtAnswer
    from dvtcli.session import Session

#: How long a script may take by itself (s), what its words wait for devices not counted; and Tcl commands it may run.
MOST_SECONDS = 600.0
MOST_STEPS = 100_000_000
#: How often (s) it is looked after whether the script must stop.
_TICK_S = 0.1
_NO_COMMAND = re.compile(r'invalid command name "(\w+)"')
_FILE_LINE = re.compile(r'\(file "(.*)" line (\d+)\)')


class _Ended(Exception):
    """A command inside a script failed and was shown; *code* is its exit code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


def run_tcl(session: Session, data: bytes, source: str, *, keep_going: bool, most_seconds: float | None) -> int:
    """Run the Tcl script *source*, whose content is *data*, inside one NMT gate; its exit code.

    Raises DvtcliError where Python has no Tcl, UsageError or InputFileError with FILE:LINE for a script that is none.
    """
    if keep_going:
        raise UsageError(
            "--keep-going is for .dvt scripts: a Tcl script runs on after an Abort by itself, and looks at the answers"
        )
    refuse_own_run(session, source)
    if not Path(source).is_file():  # Tcl reads it itself: a pipe would be empty by then
        raise UsageError(f"{source}: a Tcl script is a file", place=source)
    text, tcl = script_text(data, source), bare_interpreter()
    try:
        script = TclScript(session, source, tcl, most_seconds or MOST_SECONDS)
        script.check(text)
        session.started = True
        return enclosed(session, source, script.run)
    finally:
        tcl.close()


class TclScript:
    """One run of the Tcl script at *source*: it may compute for *most_seconds* of its own, *most_steps* commands."""

    def __init__(
        self, session: Session, source: str, tcl: BareInterpreter, most_seconds: float, most_steps: int = MOST_STEPS
    ) -> None:
        self._session, self._source, self._most_s, self._most_steps = session, source, most_seconds, most_steps
        self._path = Path(source).resolve()
        self._tcl = tcl
        self._commands = Commands(session, self._tcl, self._path.parent, self._stop)
        self._raised: BaseException | None = None
        #: the last refusal that Tcl was told of, with its place: what ends the script if nothing catches it
        self._refused: tuple[str, str] = ("", "")
        self._failures: list[tuple[str, DvtAnswer]] = []
        self._too_long = False
        self._started_s = self._waited_s = 0.0

    def check(self, text: str) -> None:
        """Raise UsageError with the line where a command begins that never ends."""
        if self._complete(text):
            return
        began, pending = 1, ""
        for number, line in enumerate(text.split("\n"), 1):
            pending += line + "\n"
            if self._complete(pending):
                began, pending = number + 1, ""
        place = f"{self._source}:{began}"
        raise UsageError(f"{place}: a brace, bracket or quote that begins here is not closed", place=place)

    def _complete(self, text: str) -> bool:
        return bool(int(self._tcl.call("info", "complete", text)))

    def run(self) -> int:
        """Run it to its end; its exit code. Raises what a word raised that is neither Abort nor Timeout."""
        self._register()
        cancellation = self._session.cancellation
        cancellation.active = True  # a Ctrl-C is seen at the next tick or word: Tcl itself cannot be torn apart
        wrong: Exception | None = None
        self._started_s = time.monotonic()
        self._arm()
        try:
            self._tcl.call("interp", "invokehidden", SAFE, "source", "-encoding", "utf-8", str(self._path))
        except self._tcl.error as failed:
            wrong = failed
        finally:
            cancellation.active = False
            self._commands.flush()
        return self._outcome(wrong)

    def _outcome(self, wrong: Exception | None) -> int:
        if isinstance(self._raised, _Ended):
            return self._raised.code
        if self._raised is not None:
            raise self._raised
        if self._session.cancellation.requested:
            raise KeyboardInterrupt
        if self._commands.exit_code is not None:
            return self._commands.exit_code
        if wrong is not None:
            raise self._failure(str(wrong))
        return self._verdict()

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

    def _failure(self, message: str) -> DvtcliError:
        """What ended the script, with its place."""
        self._session.place = None  # the text below has the place
        info = str(self._tcl.call("set", "::errorInfo"))
        at = _FILE_LINE.search(info)
        place = self._place(at[1], int(at[2])) if at else self._source
        if self._too_long:
            return InputFileError(
                f"{place}: stopped after {self._most_s:g} s of computing: it seems to run without end",
                place=place, hint="what its words have set stays set; run --max-seconds N gives it more",
            )  # fmt: skip
        if message == self._refused[0]:
            place = self._refused[1]
        if "limit exceeded" in message:
            return InputFileError(f"{place}: stopped after {self._most_steps} Tcl commands", place=place)
        return UsageError(
            f"{place}: {message}", place=place,
            hint=f"{_modern(message)}the script ended at this line; what it had set before stays set",
        )  # fmt: skip

    def _register(self) -> None:
        tcl = self._tcl
        tcl.createcommand("dvt_word", self._called)
        tcl.createcommand("dvt_tick", self._tick)
        tcl.eval(BRIDGE)
        plain = [*(name for name, word in WORDS.items() if word.where), "dvtcli", *self._commands.names]
        for name in plain:
            tcl.call("interp", "alias", SAFE, name, "", "dvt_call", name)
        for name in ("source", "open"):
            tcl.call("interp", "alias", SAFE, name, "", f"dvt_{name}")
        tcl.call("interp", "limit", SAFE, "commands", "-value", self._most_steps)
        tcl.call("interp", "eval", SAFE, "set argc 0; set argv {}")
        tcl.call("interp", "eval", SAFE, "rename ::tcl::chan::pipe {}")  # nobody would read what is written there

    def _arm(self) -> None:
        """Have `_tick` called in a moment, wherever Tcl is then; nothing but this lets the script go on."""
        until = time.time() + _TICK_S
        self._tcl.call(
            "interp", "limit", SAFE, "time", "-seconds", int(until), "-milliseconds", int(until % 1 * 1000),
            "-command", "dvt_tick",
        )  # fmt: skip

    def _tick(self) -> str:
        try:
            self._too_long = time.monotonic() - self._started_s - self._waited_s > self._most_s
            if not self._too_long and not self._session.cancellation.requested:
                self._arm()
        except BaseException as raised:  # noqa: BLE001 - Tcl swallows what is raised here: `run` raises it again
            self._raised = raised
        return ""

    def _called(self, name: str, *texts: str) -> tuple[int, str]:
        """A command of ours was called: (0, its answer), or (1, why not) for an error that the script may catch."""
        began = time.monotonic()
        try:
            self._session.place = self._here()
            return 0, self._interruptible(name, texts)
        except UsageError as wrong:
            text = f"{wrong.text}; {wrong.hint}" if wrong.hint else wrong.text
            self._refused = (text, self._session.place or self._source)
            return 1, text
        except RecursionError:  # the script has made a command that calls ours out of one that we call
            return 1, "too many nested evaluations: a word calls itself"
        except BaseException as raised:  # noqa: BLE001 - Tcl swallows what is raised here: `run` raises it again
            self._raised = raised
            self._stop()
            return 1, "stopped"
        finally:
            self._waited_s += time.monotonic() - began

    def _interruptible(self, name: str, texts: tuple[str, ...]) -> str:
        """Run a command of ours, which a Ctrl-C ends as it does outside of Tcl."""
        self._session.cancellation.active = False
        try:
            return self._run(name, texts)
        finally:
            self._session.cancellation.active = True

    def _run(self, name: str, texts: tuple[str, ...]) -> str:
        if self._session.cancellation.requested:
            raise KeyboardInterrupt
        if name == "dvtcli":
            refuse_beyond_nodes(texts)
            code = run_words(texts, self._session)
            if code:
                raise _Ended(code)
            return "OK"
        if name in self._commands.names:
            return self._commands.run(name, texts)
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

    def _here(self) -> str:
        """`FILE:LINE` of the script's command that called us."""
        try:
            found = str(self._tcl.eval("dvt_here"))
        except self._tcl.error as failed:  # the script calls itself so deep that not even this goes on
            raise UsageError(str(failed)) from failed
        line, _, file = found.partition(" ")
        return self._place(file, int(line)) if file else self._source

    def _place(self, file: str, line: int) -> str:
        shown = self._source if file == str(self._path) else Path(file).name
        return f"{shown}:{line}"

    def _stop(self) -> None:
        """End the script at its next command, past any `catch`."""
        self._tcl.call("interp", "cancel", "-unwind", "--", SAFE, "stopped")


def _modern(message: str) -> str:
    """How a command of dvtcli is called in Tcl, where Tcl's *message* is that it has none of that name."""
    found = _NO_COMMAND.fullmatch(message)
    return f"in a Tcl script it is `dvtcli {found[1]} …`; " if found and found[1] in command_names() else ""
