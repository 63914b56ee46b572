"""A request to stop, set by a signal and obeyed at a safe point."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dvtcli.errors import Interrupted

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.errors import State

#: Exit code of what Ctrl-C stopped.
INTERRUPTED = 130


class Cancellation:
    """*requested* is set by a signal; *active* defers the stop to the next safe point while a device is written.

    *exit_code* is the exit code of the stopped command: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.
    """

    def __init__(self) -> None:
        self.requested = False
        self.active = False
        self.exit_code = INTERRUPTED
        self._rolling_back = self._late = False

    def asked(self, exit_code: int, *, insists: bool) -> bool:
        """Record a signal with *exit_code*; true if the work must stop immediately.

        While a device is written, the first signal waits for the next safe point. Only a second signal that *insists*
        stops the work at once.
        """
        if self.exit_code == INTERRUPTED:  # a Ctrl-C ends a line, the others end the program, whatever came before
            self.exit_code = exit_code
        if not self.active:
            return True
        again = self._late if self._rolling_back else self.requested
        if self._rolling_back:
            self._late = True
        else:
            self.requested = True
        return again and insists

    def interrupted(
        self, text: str, *, node: int | None = None, state: State = "unchanged", hint: Hint | None = None
    ) -> Interrupted:
        """The error of work that a request stopped, with its exit code."""
        error = Interrupted(text, node=node, state=state, hint=hint)
        error.exit_code = self.exit_code
        return error

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Defer a request during the block to the next safe point."""
        outer, self.active = self.active, True
        try:
            yield
        finally:
            self.active = outer

    @contextmanager
    def released(self) -> Iterator[None]:
        """Obey a request at once during the block, in which nothing is written (a question to the user)."""
        outer, self.active = self.active, False
        try:
            yield
        finally:
            self.active = outer

    @contextmanager
    def rolling_back(self) -> Iterator[None]:
        """Run a roll-back without stopping at safe points; a request waits until the end of the block."""
        outer, self.requested = self.requested, False
        self._rolling_back, self._late = True, False
        try:
            with self.deferred():
                yield
        finally:
            self.requested = outer or self._late
            self._rolling_back = self._late = False

    def hold(self) -> None:
        """Defer new requests until `release`: the change is complete and can no longer be stopped."""
        self.active = True

    def release(self) -> None:
        """End of the line: obey a request at once again."""
        self.active = False

    def reset(self) -> None:
        """Forget an earlier request, before a new command."""
        self.requested, self.active = False, False
