"""What Ctrl-C, SIGTERM, SIGHUP and Ctrl-Break do: stop at once, except while a device is being written.

Does not know what is written, nor how a stopped command is told of.
"""

from __future__ import annotations

import os
import select
import signal
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

    from dvtcli.device.cancellation import Cancellation

_WAITS = b"\nstopping at the next safe point (once more: at once)\n"


def catch_signals(cancellation: Cancellation) -> None:
    """Hand every signal that ends a program to *cancellation*; SIGHUP not under `nohup`."""

    def stop(number: int, _frame: FrameType | None) -> None:
        # a closed terminal sends SIGHUP twice, through its shell and by itself: nobody insists on anything with it
        insists = number in (signal.SIGINT, signal.SIGTERM)
        if cancellation.asked(128 + number, insists=insists):
            raise KeyboardInterrupt
        _say(_WAITS)

    # Windows has no SIGHUP: there a console that is closed says SIGBREAK, as Ctrl-Break does
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        number = getattr(signal, name, None)
        if number is None or (name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN):
            continue
        signal.signal(number, stop)


def _say(text: bytes) -> None:
    """Write to stderr where that neither waits nor fails: whoever read it may be gone, or have stopped reading."""
    with suppress(OSError, ValueError):
        if os.name == "nt" or select.select((), (2,), (), 0)[1]:
            os.write(2, text)
