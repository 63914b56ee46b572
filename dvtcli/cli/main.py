"""The program: argv in, exit code out."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

from dvtcli.cli.boundary import COMPLETING, LEAVE, guarded
from dvtcli.cli.conversation import Conversation
from dvtcli.cli.registry import REGISTRY
from dvtcli.cli.view.output import Output
from dvtcli.cli.ways_in import install

if TYPE_CHECKING:
    from dvtcli.operations.user.session_user import SessionUser


def main(argv: list[str] | None = None) -> int:
    """Run dvtcli with *argv* (default: the process's own) and return its exit code."""
    install()
    session = Conversation(Output(), on_open=lambda: _catch_signals(session))
    words = sys.argv[1:] if argv is None else argv
    if "--json" in words:  # also for errors that are found before the option is read
        session.start({"format": "json"})

    def run() -> Any:
        given: dict[str, Any] = {"obj": session}
        if COMPLETING in os.environ:  # a shell asks: click answers, and ends the program
            from dvtcli.cli.shell_completion import make_shells_safe

            make_shells_safe()
            return REGISTRY.main(words, prog_name="dvtcli", standalone_mode=False, **given)
        # not by click's own `main`: that writes to a stderr that may be gone when it hears a Ctrl-C, and takes any
        # broken pipe, a driver's too, for the program's end
        with REGISTRY.make_context("dvtcli", list(words), **given) as ctx:
            return REGISTRY.invoke(ctx)

    code = guarded(session, run)
    code = 0 if code == LEAVE else code
    settling = guarded(session, lambda: session.end_line(code, alone=not session.started))
    closing = guarded(session, lambda: _closed(session))
    session.cancellation.hold()  # what comes now comes too late to be answered
    if code == 0 and session.cancellation.requested:
        session.output.note("the signal came too late to stop it: it is complete, and what it did stays")
    return code or settling or closing


def _catch_signals(session: SessionUser) -> None:
    from dvtcli.cli.stop_signals import catch_signals

    catch_signals(session.cancellation)


def _closed(session: Conversation) -> None:
    with session.cancellation.guard():
        session.close()
