"""The process of a Tcl script as seen by its parent: asked in turn, with a timeout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dvtcli.cli.dvt.tcl_wire import Frame, Gone, receive, send
from dvtcli.files.bounded_process import BoundedProcess, child_command


class Late(Exception):
    """The process did not answer in time, and was killed."""


class TclProcess(BoundedProcess):
    """The process as long as the block runs; *command* starts it (a substitute in tests)."""

    def __init__(self, command: Sequence[str] | None = None) -> None:
        super().__init__(child_command("dvtcli.cli.dvt.tcl_child") if command is None else command, "Tcl")

    def asked(self, frame: Frame, seconds: float, *kinds: type[Any]) -> Any:
        """Send *frame* and wait up to *seconds* for an answer of *kinds*.

        Raises Late on timeout, Gone if the process ended, WireError for any other answer.
        """
        try:
            with self.within(seconds):
                send(self.stdin, frame)
                return receive(self.stdout, *kinds)
        except Gone as gone:
            raise (Late if self.is_late else Gone) from gone
