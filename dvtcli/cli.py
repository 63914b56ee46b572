"""The program: argv in, exit code out."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

from dvtcli.options import file_defaults
from dvtcli.session import Session
from dvtcli.shell import LEAVE, REGISTRY, boundary
from dvtcli.view.output import Output

if TYPE_CHECKING:
    from types import FrameType


def main(argv: list[str] | None = None) -> int:
    """Run dvtcli with *argv* (default: the process's own) and return its exit code."""
    session = Session(Output(), on_open=lambda: _catch_signals(session))
    words = sys.argv[1:] if argv is None else argv
    if "--json" in words:  # also for errors that are found before the option is read
        session.start({"format": "json"})

    def run() -> Any:
        return REGISTRY.main(words, prog_name="dvtcli", standalone_mode=False, obj=session, default_map=file_defaults())

    code = boundary(session, run)
    code = 0 if code == LEAVE else code
    settling = boundary(session, lambda: session.end_line(code))
    closing = boundary(session, session.close)
    return code or settling or closing


def _catch_signals(session: Session) -> None:
    """Ctrl-C and SIGTERM stop at once, except while a device is being written: then at the next safe point."""
    import signal

    cancellation = session.cancellation

    def stop(number: int, _frame: FrameType | None) -> None:
        cancellation.exit_code = 128 + number
        if cancellation.active and not cancellation.requested:
            cancellation.requested = True
            os.write(2, b"\nstopping at the next safe point (once more: at once)\n")
            return
        raise KeyboardInterrupt

    for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # a terminal that is closed sends SIGHUP; Windows has none
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), stop)
