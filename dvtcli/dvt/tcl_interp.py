"""The standard library's Tcl interpreter, bare: no window, no profile of the user's. Knows nothing of words."""

from __future__ import annotations

from typing import Any

from dvtcli.errors import DvtcliError

#: Name of the safe interpreter inside, in which the script runs.
SAFE = "dvt"
#: How the script reaches us: `dvt_call` turns an answer into a result or an error; the rest needs hidden commands.
BRIDGE = """
proc dvt_call {args} {
    lassign [dvt_word {*}$args] failed text
    if {$failed} {return -code error $text}
    return $text
}
proc dvt_source {args} {
    set path [dvt_call source {*}$args]
    interp invokehidden dvt source -encoding utf-8 $path
}
proc dvt_open {args} {
    set path [dvt_call open {*}$args]
    interp invokehidden dvt open $path r
}
proc dvt_here {} {
    interp eval dvt {apply {{} {
        for {set level [info frame]} {$level > 0} {incr level -1} {
            set frame [info frame $level]
            if {[dict get $frame type] eq "source"} {return "[dict get $frame line] [dict get $frame file]"}
        }
        return "0 "
    } ::}}
}
"""


class BareInterpreter:
    """Tcl with one safe interpreter inside; *error* is what its calls raise."""

    def __init__(self) -> None:
        import tkinter

        class Bare(tkinter.Tk):
            def readprofile(self, baseName: str, className: str) -> None:  # noqa: N803 - tkinter's names
                """Read no file of the user's home: a script must do the same everywhere."""

        self.error = tkinter.TclError
        self._interpreter = Bare(useTk=False)
        self._tk = self._interpreter.tk
        self._created: list[str] = []
        self.call("interp", "create", "-safe", SAFE)

    def call(self, *words: object) -> Any:
        """Run one command of the outer interpreter."""
        return self._tk.call(*words)

    def eval(self, script: str) -> Any:
        """Run *script*, which is ours, in the outer interpreter."""
        return self._tk.eval(script)

    def createcommand(self, name: str, function: Any) -> None:
        """Let Tcl call *function* as *name* in the outer interpreter."""
        self._tk.createcommand(name, function)
        self._created.append(name)

    def close(self) -> None:
        """Delete the interpreter now, in this thread.

        Tcl aborts the process where garbage collection deletes it in another thread.
        """
        for name in self._created:  # they hold whoever called us, and so the interpreter itself
            self._tk.deletecommand(name)
        del self._tk, self._interpreter


def bare_interpreter() -> BareInterpreter:
    """A fresh interpreter; DvtcliError with the package to install where Python has no Tcl."""
    try:
        return BareInterpreter()
    except ImportError as missing:
        raise DvtcliError(
            "Tcl scripts need Python's tkinter, which is not installed",
            why=str(missing),
            hint="install python3-tk (Debian, Ubuntu), python3-tkinter (Fedora) or python-tk (Homebrew); "
            ".dvt scripts need none",
        ) from missing
