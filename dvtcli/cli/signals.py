"""Signals that end a program: handed to the cancellation of a session, and repeated if Python swallows them."""

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

#: delay (s) before repeating a swallowed signal: at the same place it would be swallowed again
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
    """Repeats a signal whose KeyboardInterrupt was swallowed.

    A `__del__` swallows exceptions, e.g. python-can's after a failed open: Python prints the exception and continues.
    `hear` swallows too, so a signal during it must not raise.
    """

    def __init__(self, shown: Callable[[sys.UnraisableHookArgs], object]) -> None:
        self.number = int(signal.SIGINT)
        self.being_heard = self.again = self._on_its_way = False
        self._shown = shown

    def hear(self, lost: sys.UnraisableHookArgs) -> None:
        """Handle an exception that Python swallows (`sys.unraisablehook`)."""
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
    """Send the signal *number* to this process, and wake its main thread."""
    if sys.platform == "win32":
        signal.raise_signal(number)
    else:
        os.kill(os.getpid(), number)


def _say(text: bytes) -> None:
    """Write to stderr if possible without waiting or failing: the reader may be gone or blocked."""
    with suppress(OSError, ValueError):
        if os.name == "nt" or select.select((), (2,), (), 0)[1]:
            os.write(2, text)
