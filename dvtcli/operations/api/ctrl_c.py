"""Ctrl-C during a call of the Python API: obeyed where a device is in a known state. Knows no device."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

    from dvtcli.device.cancellation import Cancellation


@contextmanager
def ctrl_c_at_safe_points(cancellation: Cancellation) -> Iterator[None]:
    """While the block runs a Ctrl-C waits for a safe point, a second one does not.

    Only in the main thread, and only where Python's own handler is in force: a program's own handler stays.
    """
    if threading.current_thread() is not threading.main_thread() or (
        signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return

    def stop(number: int, _frame: FrameType | None) -> None:
        if cancellation.asked(128 + number, insists=True):
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
