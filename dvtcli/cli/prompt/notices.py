"""Asynchronous messages while a line is typed: a few per second, then only their number."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

Show = Callable[[str], None]

#: Messages shown in a second; a person reads no more, and a prompt that scrolls away cannot be typed at.
A_SECOND = 10


class Notices:
    """Keeps messages until they may be shown; `add` may be called by any thread and never waits for the terminal."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        #: held briefly, never while waiting for the terminal
        self._counting = threading.Lock()
        self._waiting: deque[str] = deque(maxlen=A_SECOND)
        self._show: Show | None = None
        self._second = 0.0
        self._shown = 0
        self._withheld = 0

    def add(self, text: str) -> None:
        """Take a message; while more than `A_SECOND` wait, the later ones are only counted."""
        with self._counting:
            if len(self._waiting) < A_SECOND:
                self._waiting.append(text)
            else:
                self._withheld += 1

    @contextmanager
    def shown_by(self, show: Show) -> Iterator[None]:
        """While the block runs, `pump` passes messages to *show*."""
        with self._lock:
            self._show = show
        try:
            yield
        finally:
            with self._lock:
                self._show = None

    def pump(self) -> None:
        """Show what waits and may be shown now; to be called a few times a second."""
        with self._lock:
            if self._show is None:
                return
            if monotonic() - self._second >= 1:
                self._tell_withheld(self._show)
                self._second, self._shown = monotonic(), 0
            while self._waiting and self._shown < A_SECOND:
                self._show(self._waiting.popleft())
                self._shown += 1

    def _tell_withheld(self, show: Show) -> None:
        with self._counting:  # what comes while this is shown belongs to the next count
            withheld, self._withheld = self._withheld, 0
        if withheld:
            show(f"{withheld} more messages of nodes are not shown")
