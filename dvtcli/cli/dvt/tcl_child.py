"""The process of a Tcl script: its interpreter, its limits, and the pipe to its parent."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Sequence
from queue import SimpleQueue
from typing import IO, Any

from dvtcli.cli.dvt.tcl_wire import (
    MOST_CHARACTERS,
    Call,
    CallResult,
    End,
    Go,
    Gone,
    Ready,
    Setup,
    TclLine,
    WireError,
    receive,
    send,
)
from dvtcli.files.bounded_child import die_of, limit


def main() -> None:
    """Run the script named by the parent, then end the process without Python's and Tcl's exit handlers."""
    try:
        _serve(Parent())
    except BaseException as bug:  # noqa: BLE001 - nobody above: the parent reads of it
        die_of(bug)
    os._exit(0)


def _serve(parent: Parent) -> None:
    setup = parent.told()
    assert isinstance(setup, Setup)  # noqa: S101 - the parent begins with it
    try:
        tcl = BareInterpreter()
    except ImportError as missing:
        parent.tell(Ready(str(missing), 0))
        return
    limit(setup.memory_bytes)
    script = Script(parent, setup, tcl)
    if not setup.path:
        parent.tell(Ready("", 0))
        script.register()
        while isinstance(typed := parent.told(), TclLine):
            parent.tell(script.line(typed.text))
        return
    unclosed = script.unclosed()
    parent.tell(Ready("", unclosed))
    if not unclosed:
        parent.told()
        parent.tell(script.run())


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
        for kind, value in (("commands", "-value"), ("time", "-seconds")):  # one that is passed lets nothing be asked
            self._tcl.call("interp", "limit", SAFE, kind, value, "")
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


#: For the thread that waits for answers: the usual 8 MiB would count as the script's memory.
_STACK_BYTES = 1 << 18


class Parent:
    """The process that owns the bus; if it ends, this process ends at once."""

    def __init__(self) -> None:
        self._answers, self._calls = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1):  # Tcl has channels of its own for these
            os.dup2(nothing, stream)
        os.close(nothing)
        self._received: SimpleQueue[Setup | Go | TclLine | CallResult] = SimpleQueue()
        threading.stack_size(_STACK_BYTES)
        threading.Thread(target=_hear, args=(self._answers, self._received), daemon=True).start()

    def told(self) -> Setup | Go | TclLine | CallResult:
        """Wait for the parent's next message."""
        return self._received.get()

    def asked(self, call: Call) -> CallResult:
        """Return the parent's answer to *call*."""
        self.tell(call)
        answer = self.told()
        assert isinstance(answer, CallResult)  # noqa: S101 - calls and answers take turns
        return answer

    def tell(self, frame: Ready | Call | End) -> None:
        """Say something."""
        send(self._calls, frame)


def _hear(answers: IO[bytes], received: SimpleQueue[Setup | Go | TclLine | CallResult]) -> None:
    try:
        while True:
            received.put(receive(answers, Setup, Go, TclLine, CallResult))
    except (Gone, WireError, MemoryError):
        os._exit(1)


#: Name of the inner safe interpreter, which runs the script.
SAFE = "dvt"
#: How the script reaches us: `dvt_call` turns an answer into a result or an error; the rest needs hidden commands.
#: All of it runs in the outer interpreter, whose commands no script can redefine. For the place of a call the
#: original of `info frame` is hidden from the script, which has an alias for it: hidden, nobody can bend it.
BRIDGE = f"""
proc dvt_call {{name args}} {{
    set length 0
    foreach text $args {{incr length [string length $text]}}
    if {{$length > {MOST_CHARACTERS}}} {{
        return -code error [dvt_refuse "$name: $length characters are too many: one call takes {MOST_CHARACTERS}"]
    }}
    lassign [dvt_word $name {{*}}$args] failed text
    if {{$failed}} {{return -code error $text}}
    return $text
}}
proc dvt_source {{args}} {{
    set path [dvt_call source {{*}}$args]
    interp invokehidden {SAFE} source -encoding utf-8 $path
}}
proc dvt_open {{args}} {{
    set path [dvt_call open {{*}}$args]
    interp invokehidden {SAFE} open $path r
}}
interp eval {SAFE} {{rename ::tcl::info::frame ::dvt_frame}}
interp hide {SAFE} dvt_frame
proc dvt_frame {{args}} {{interp invokehidden {SAFE} dvt_frame {{*}}$args}}
interp alias {SAFE} ::tcl::info::frame {{}} dvt_frame
interp eval {SAFE} {{rename ::tcl::info::cmdcount ::dvt_count}}
interp hide {SAFE} dvt_count
proc dvt_count {{}} {{interp invokehidden {SAFE} dvt_count}}
interp alias {SAFE} ::tcl::info::cmdcount {{}} dvt_count
proc dvt_here {{}} {{
    for {{set level [dvt_frame]}} {{$level > 0}} {{incr level -1}} {{
        set frame [dvt_frame $level]
        if {{[dict get $frame type] eq "source"}} {{return "[dict get $frame line] [dict get $frame file]"}}
    }}
    return "0 "
}}
"""


class BareInterpreter:
    """Tcl with one safe interpreter inside; *error* is raised by its calls.

    Raises ImportError if Python has no Tcl.
    """

    def __init__(self) -> None:
        import tkinter

        class Bare(tkinter.Tk):
            def readprofile(self, baseName: str, className: str) -> None:  # noqa: N803 - tkinter's names
                """Read no file of the user's home: a script must do the same everywhere."""

        self.error = tkinter.TclError
        self._interpreter = Bare(useTk=False)
        self._tk = self._interpreter.tk
        self.call("interp", "create", "-safe", SAFE)

    def call(self, *words: object) -> Any:
        """Run a command of the outer interpreter."""
        return self._tk.call(*words)

    def eval(self, script: str) -> Any:
        """Run a trusted *script* in the outer interpreter."""
        return self._tk.eval(script)

    def createcommand(self, name: str, function: Any) -> None:
        """Let Tcl call *function* as *name* in the outer interpreter."""
        self._tk.createcommand(name, function)
