"""A request to stop, made by a signal and obeyed at a safe point. Does not know signals."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

#: Exit code of what Ctrl-C stopped.
INTERRUPTED = 130


class Cancellation:
    """*requested* is set from outside; *active* says that a device is being written and stopping must wait.

    *exit_code* is what the stopped command ends with: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.
    """

    def __init__(self) -> None:
        self.requested = False
        self.active = False
        self.exit_code = INTERRUPTED
        self._way_back = self._late = False

    def asked(self, exit_code: int, *, insists: bool) -> bool:
        """A signal came that ends with *exit_code*; whether the work must stop here and now.

        While a device is written the first one waits for the next safe point, and only a second one that *insists*
        tears the work apart.
        """
        if self.exit_code == INTERRUPTED:  # a Ctrl-C ends a line, the others end the program, whatever came before
            self.exit_code = exit_code
        if not self.active:
            return True
        again = self._late if self._way_back else self.requested
        if self._way_back:
            self._late = True
        else:
            self.requested = True
        return again and insists

    @contextmanager
    def guard(self) -> Iterator[None]:
        """While the block runs, a request is kept for the next safe point instead of tearing the work apart."""
        outer, self.active = self.active, True
        try:
            yield
        finally:
            self.active = outer

    @contextmanager
    def released(self) -> Iterator[None]:
        """While the block runs nothing is written, as where a question is asked: a request stops at once."""
        outer, self.active = self.active, False
        try:
            yield
        finally:
            self.active = outer

    @contextmanager
    def way_back(self) -> Iterator[None]:
        """While the block puts things back, no request stops it at a safe point: there is none before its end."""
        outer, self.requested = self.requested, False
        self._way_back, self._late = True, False
        try:
            with self.guard():
                yield
        finally:
            self.requested = outer or self._late
            self._way_back = self._late = False

    def hold(self) -> None:
        """A change is complete: a request that comes now is too late for it, and waits until `release`."""
        self.active = True

    def release(self) -> None:
        """The line has ended: a request stops at once again."""
        self.active = False

    def reset(self) -> None:
        """Forget an earlier request, before a new command."""
        self.requested, self.active = False, False
