"""What Ctrl-C, SIGTERM, SIGHUP and Ctrl-Break do: stop at once, except while a device is being written.

Does not know what is written, nor how a stopped command is told of.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

    from dvtcli.device.cancellation import Cancellation

#: how long (s) after it was swallowed a signal is heard again: in that very place it would be swallowed again
_AGAIN_S = 0.02
_WAITS = b"\nstopping at the next safe point (once more: at once)\n"
_LOST = b"\nthat signal came at a moment that lets none through: once more\n"


def catch_signals(cancellation: Cancellation) -> None:
    """Hand every signal that ends a program to *cancellation*; SIGHUP not under `nohup`."""

    swallowed = _Swallowed(sys.unraisablehook)

    def stop(number: int, _frame: FrameType | None) -> None:
        swallowed.number = number
        if swallowed.being_heard:
            swallowed.again = True
            return
        # a closed terminal sends SIGHUP twice, through its shell and by itself: nobody insists on anything with it
        insists = number in (signal.SIGINT, signal.SIGTERM)
        if cancellation.asked(128 + number, insists=insists):
            raise KeyboardInterrupt
        _say(_WAITS)

    sys.unraisablehook = swallowed.hear
    # Windows has no SIGHUP: there a console that is closed says SIGBREAK, as Ctrl-Break does
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        number = getattr(signal, name, None)
        if number is None or (name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN):
            continue
        signal.signal(number, stop)


class _Swallowed:
    """Sends a signal once more whose KeyboardInterrupt fell into a place that lets none through.

    Such a place is a `__del__`, as python-can's of a bus that did not open: Python shows what is raised there, and goes
    on as if nobody had asked to stop. `hear` is such a place, too: a signal that comes meanwhile must raise nothing.
    """

    def __init__(self, shown: Callable[[sys.UnraisableHookArgs], object]) -> None:
        self.number = int(signal.SIGINT)
        self.being_heard = self.again = self._on_its_way = False
        self._shown = shown

    def hear(self, lost: sys.UnraisableHookArgs) -> None:
        """What Python calls with each exception that it lets no further (`sys.unraisablehook`)."""
        self.being_heard = True  # before anything is called, behind which a signal may come
        self.again = issubclass(lost.exc_type, KeyboardInterrupt)
        try:
            if not self.again:
                self._shown(lost)
        finally:  # what cannot be shown must not keep a signal from being heard
            try:
                while self.again:
                    self.again = False
                    self._send_soon()
            finally:
                self.being_heard = False

    def _send_soon(self) -> None:
        if self._on_its_way:  # who asked once does not insist
            return
        timer = threading.Timer(_AGAIN_S, self._send)
        timer.daemon = True
        self._on_its_way = True
        try:
            timer.start()
        except RuntimeError:  # no thread can be started: nobody is there to send it
            self._on_its_way = False
            _say(_LOST)

    def _send(self) -> None:
        self._on_its_way = False
        _send(self.number)


def _send(number: int) -> None:
    """Send the signal *number* to this program, and wake what its main thread waits for."""
    if sys.platform == "win32":
        signal.raise_signal(number)
    else:
        os.kill(os.getpid(), number)


def _say(text: bytes) -> None:
    """Write to stderr where that neither waits nor fails: whoever read it may be gone, or have stopped reading."""
    with suppress(OSError, ValueError):
        if os.name == "nt" or select.select((), (2,), (), 0)[1]:
            os.write(2, text)
