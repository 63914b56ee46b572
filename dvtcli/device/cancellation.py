"""A request to stop, made by a signal and obeyed at a safe point. Does not know signals."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class Cancellation:
    """*requested* is set from outside; *active* says that a device is being written and stopping must wait.

    *exit_code* is what the stopped command ends with: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.
    """

    def __init__(self) -> None:
        self.requested = False
        self.active = False
        self.exit_code = 130

    @contextmanager
    def guard(self) -> Iterator[None]:
        """While the block runs, a request is kept for the next safe point instead of tearing the work apart."""
        self.active = True
        try:
            yield
        finally:
            self.active = False

    def reset(self) -> None:
        """Forget an earlier request, before a new command."""
        self.requested, self.active = False, False
