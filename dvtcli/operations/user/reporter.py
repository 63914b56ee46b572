"""Messages and questions of an operation to its user, besides its result.

Each program supplies its own reporter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.bus_events import BusEvent


class Reporter(Protocol):
    """A receiver of messages: a screen, a test bench's log, or nothing."""

    def note(self, text: Hint | str) -> None:
        """Something good to know."""

    def warning(self, text: Hint | str) -> None:
        """Report a warning, even if only errors are wanted."""

    def bus(self, event: BusEvent) -> None:
        """The bus is gone, or back."""

    def instruct(self, text: str) -> None:
        """Report what the user must do by hand now for the operation to continue."""

    def ask(self, question: str) -> bool | None:
        """Ask; returns None if nobody can answer. Raises KeyboardInterrupt if cancelled."""

    def confirm(self, question: str, word: str) -> bool | None:
        """Ask for *word* to be typed, where a yes is too easily given; returns as `ask`."""

    def progress(self, text: str, done: int, total: int) -> None:
        """Report progress in words and as *done* of *total* (0: unknown), of work that may take long."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Report a frame on the bus, if wanted; its bytes *secret* belong to a passcode."""


class NullReporter:
    """Reports to nobody, and nobody can answer."""

    def note(self, text: Hint | str) -> None:
        """Ignore it."""

    def warning(self, text: Hint | str) -> None:
        """Ignore it."""

    def bus(self, event: BusEvent) -> None:
        """Ignore it."""

    def instruct(self, text: str) -> None:
        """Ignore it."""

    def ask(self, question: str) -> bool | None:  # noqa: ARG002
        """Nobody can answer."""
        return None

    def confirm(self, question: str, word: str) -> bool | None:  # noqa: ARG002
        """Nobody can answer."""
        return None

    def progress(self, text: str, done: int, total: int) -> None:
        """Show nothing."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Show nothing."""
