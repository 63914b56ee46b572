"""Run a Tcl script in its own process, with limits of time and steps; the parent serves the commands.

Imports only its neighbours of dvtcli.
"""

from __future__ import annotations

import re
import time
from collections.abc import Sequence

from dvtcli.cli.dvt.tcl_interp import BRIDGE, SAFE, BareInterpreter
from dvtcli.cli.dvt.tcl_parent import Parent
from dvtcli.cli.dvt.tcl_wire import MOST_CHARACTERS, Call, End, Setup
from dvtcli.files.bounded_child import die_of

#: Interval of checks whether the script must stop (s).
_TICK_S = 0.1
#: Subcommands of `file` that use names only, answered here.
_NAMES_ONLY = ("dirname", "tail", "extension", "rootname", "join", "split")
#: Up to this length (characters) a command is checked after each of its lines, beyond less often.
_EXACT = 1 << 16
#: Tcl's message if out of memory without an abort.
_NO_ROOM = re.compile("out of memory|unable to (re)?alloc|max size for a Tcl value|max length of a Tcl list")
_FILE_LINE = re.compile(r'\(file "((?:(?!\(file ").)*)" line (\d+)\)')


class Script:
    """A run of the script in *setup*, in *tcl*."""

    def __init__(self, parent: Parent, setup: Setup, tcl: BareInterpreter) -> None:
        self._parent, self._setup, self._tcl = parent, setup, tcl
        #: the last refusal with its place, which ends the script unless caught
        self._refused: tuple[str, int, str] = ("", 0, "")
        self._too_long = False
        self._started_s = self._waited_s = 0.0

    def unclosed(self) -> int:
        """Return the line of a command without end; 0 if all are complete."""
        with open(self._setup.path, encoding="utf-8-sig", errors="replace") as file:  # noqa: PTH123 - a slow import
            text = file.read()
        if self._complete(text):
            return 0
        began, start, end, tried = 1, 0, 0, 0
        for number, line in enumerate(text.split("\n"), 1):
            end += len(line) + 1
            if _EXACT < end - start < tried * 1.1:  # else the time would grow with the square of the length
                continue
            tried = end - start
            if self._complete(text[start:end]):
                began, start, tried = number + 1, end, 0
        return began

    def _complete(self, text: str) -> bool:
        return bool(int(self._tcl.call("info", "complete", text)))

    def run(self) -> End:
        """Run the script to its end."""
        self.register()
        self._arm_anew()
        try:
            self._tcl.call("interp", "invokehidden", SAFE, "source", "-encoding", "utf-8", self._setup.path)
        except self._tcl.error as failed:
            return self._failed(str(failed))
        return End("done", "", 0, "")

    def line(self, text: str) -> End:
        """Run a typed line after all before it; the message is its result."""
        if not self._complete(text):
            return End("open", "", 0, "")
        self._arm_anew()
        try:
            result = str(self._tcl.call("interp", "eval", SAFE, text))
        except self._tcl.error as failed:
            return self._failed(str(failed))
        return End("done", result[:MOST_CHARACTERS], 0, "")

    def _arm_anew(self) -> None:
        """Let everything count from now on."""
        self._refused, self._too_long = ("", 0, ""), False
        self._started_s, self._waited_s = time.monotonic(), 0.0
        for limit, value in (("commands", "-value"), ("time", "-seconds")):  # one that is passed lets nothing be asked
            self._tcl.call("interp", "limit", SAFE, limit, value, "")
        so_far = int(self._tcl.call("interp", "invokehidden", SAFE, "dvt_count"))
        self._tcl.call("interp", "limit", SAFE, "commands", "-value", so_far + self._setup.steps)
        self._arm()

    def _failed(self, message: str) -> End:
        """Return the final error of the script, with its place."""
        at = _FILE_LINE.search(str(self._tcl.call("set", "::errorInfo")))
        line, file = (int(at[2]), at[1]) if at else (0, "")
        if self._too_long:
            return End("seconds", "", line, file)
        if message == self._refused[0]:
            _, line, file = self._refused
        return End(_kind(message), message[:10_000], line, file)

    def register(self) -> None:
        """Give Tcl the served commands, and nothing else that reaches outside."""
        tcl = self._tcl
        tcl.createcommand("dvt_word", self._called)
        tcl.createcommand("dvt_refuse", self._refuse)
        tcl.createcommand("dvt_tick", self._tick)
        tcl.call("interp", "eval", SAFE, "set argc 0; set argv {}")
        tcl.call("interp", "eval", SAFE, "rename ::tcl::chan::pipe {}")  # nobody would read what is written there
        tcl.eval(BRIDGE)
        for name in self._setup.names:
            tcl.call("interp", "alias", SAFE, name, "", "dvt_call", name)
        for name in ("source", "open"):
            tcl.call("interp", "alias", SAFE, name, "", f"dvt_{name}")

    def _arm(self) -> None:
        """Have `_tick` called in a moment, wherever Tcl is then; nothing but this lets the script go on."""
        until = time.time() + _TICK_S
        self._tcl.call(
            "interp", "limit", SAFE, "time", "-seconds", int(until), "-milliseconds", int(until % 1 * 1000),
            "-command", "dvt_tick",
        )  # fmt: skip

    def _tick(self) -> str:
        computed_s = time.monotonic() - self._started_s - self._waited_s
        self._too_long = computed_s > self._setup.seconds
        if not self._too_long:
            self._arm()
        return ""

    def _called(self, name: str, *texts: str) -> tuple[bool, str]:
        """Forward a call; returns (False, answer), or (True, reason) for an error."""
        began = time.monotonic()
        try:
            if name == "file" and texts[:1] and texts[0] in _NAMES_ONLY:
                return self._names(texts)
            answer = self._parent.asked(Call(name, texts, *self._here()))
        except BaseException as bug:  # noqa: BLE001 - Tcl would swallow it, and run on
            die_of(bug)
        finally:
            self._waited_s += time.monotonic() - began
        return answer.failed, self._refuse(answer.text) if answer.failed else answer.text

    def _names(self, texts: Sequence[str]) -> tuple[bool, str]:
        try:
            return False, str(self._tcl.call("concat", self._tcl.call("file", *texts)))
        except self._tcl.error as wrong:
            return True, self._refuse(str(wrong))

    def _refuse(self, why: str) -> str:
        self._refused = (why, *self._here())
        return why

    def _here(self) -> tuple[int, str]:
        """Return line and file of the calling script command; 0 and empty if nested too deep."""
        try:
            line, _, file = str(self._tcl.eval("dvt_here")).partition(" ")
        except self._tcl.error:
            return 0, ""
        return int(line), file


def _kind(message: str) -> str:
    """Return the kind of end for Tcl's *message*."""
    if message == "command count limit exceeded":
        return "steps"
    return "memory" if _NO_ROOM.search(message) else "failed"
