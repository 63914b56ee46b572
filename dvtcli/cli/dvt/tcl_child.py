"""The process of a Tcl script: forwards served commands over a pipe, and ends with its parent.

Imports only its neighbours of dvtcli.
"""

from __future__ import annotations

import os

from dvtcli.cli.dvt.tcl_child_run import Script
from dvtcli.cli.dvt.tcl_interp import BareInterpreter
from dvtcli.cli.dvt.tcl_parent import Parent
from dvtcli.cli.dvt.tcl_wire import Ready, Setup, TclLine
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
