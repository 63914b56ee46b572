"""The process in which a Tcl script runs, seen from ours: asked in turn, within a time.

Does not know what is asked, nor what the DVT's words are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dvtcli.cli.dvt.tcl_wire import Frame, Gone, receive, send
from dvtcli.files.bounded_process import BoundedProcess, child_command


class Late(Exception):
    """It did not say anything in time, and was killed."""


class TclProcess(BoundedProcess):
    """That process while the block runs; *command* starts it (another one in tests)."""

    def __init__(self, command: Sequence[str] | None = None) -> None:
        super().__init__(child_command("dvtcli.cli.dvt.tcl_child") if command is None else command, "Tcl")

    def asked(self, frame: Frame, seconds: float, *kinds: type[Any]) -> Any:
        """Say *frame* and wait up to *seconds* for an answer of one of *kinds*.

        Raises Late if it did not come in time, Gone if the process ended, WireError for anything else.
        """
        try:
            with self.within(seconds):
                send(self.stdin, frame)
                return receive(self.stdout, *kinds)
        except Gone as gone:
            raise (Late if self.is_late else Gone) from gone
