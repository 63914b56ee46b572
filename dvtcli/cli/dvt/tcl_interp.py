"""The standard library's Tcl interpreter without window and user profile."""

from __future__ import annotations

from typing import Any

from dvtcli.cli.dvt.tcl_wire import MOST_CHARACTERS

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
