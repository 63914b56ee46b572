"""The process in which a Tcl script runs: it asks for every command of ours over a pipe, and dies with its parent.

Imports nothing of dvtcli but its neighbours. Knows no bus, no session and no words.
"""

from __future__ import annotations

import os
import sys

from dvtcli.cli.dvt.tcl_child_run import Script
from dvtcli.cli.dvt.tcl_interp import BareInterpreter
from dvtcli.cli.dvt.tcl_parent import Parent, die_of
from dvtcli.cli.dvt.tcl_wire import Ready, Setup, Typed


def main() -> None:
    """Serve the one script that the parent names, then end the process, without Python's and Tcl's own ways out."""
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
    _limit_memory(setup.memory_bytes)
    script = Script(parent, setup, tcl)
    if not setup.path:
        parent.tell(Ready("", 0))
        script.register()
        while isinstance(typed := parent.told(), Typed):
            parent.tell(script.line(typed.text))
        return
    unclosed = script.unclosed()
    parent.tell(Ready("", unclosed))
    if not unclosed:
        parent.told()
        parent.tell(script.run())


def _limit_memory(most_bytes: int) -> None:
    """Let this process take no more than *most_bytes*, where the system has such a limit; and leave no core file."""
    if sys.platform == "win32":
        return
    import resource

    for what, most in ((resource.RLIMIT_AS, most_bytes), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(what)
        lower = most if hard == resource.RLIM_INFINITY else min(most, hard)
        try:
            resource.setrlimit(what, (lower, lower))
        except (ValueError, OSError) as refused:  # macOS, below what is taken already
            os.write(2, f"no limit: {refused}\n".encode())
