"""What an operation tells its user besides its answer, and asks: whoever runs operations brings somebody who listens.

Does not know terminals, colours or documents.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.bus_events import BusEvent


class Reporter(Protocol):
    """Whoever listens: the program on its screen, a test bench in its log, nobody."""

    def note(self, text: Hint | str) -> None:
        """Something good to know."""

    def warning(self, text: Hint | str) -> None:
        """Something that nobody may miss, also where only errors are wanted."""

    def bus(self, event: BusEvent) -> None:
        """The bus is gone, or back."""

    def instruct(self, text: str) -> None:
        """What the user must do now, by hand, for the operation to go on."""

    def ask(self, question: str) -> bool | None:
        """Whether the answer is yes; None where nobody can answer. KeyboardInterrupt where it is broken off."""

    def progress(self, text: str, done: int, total: int) -> None:
        """How far work has come, in words, as parts *done* of *total* (0: nobody knows): it may take long, or not."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """A frame that passed, where the options ask for traffic; its bytes *secret* are a passcode, or tell one."""


class NullReporter:
    """Tells nobody, and nobody can answer."""

    def note(self, text: Hint | str) -> None:
        """Say nothing."""

    def warning(self, text: Hint | str) -> None:
        """Say nothing."""

    def bus(self, event: BusEvent) -> None:
        """Say nothing."""

    def instruct(self, text: str) -> None:
        """Say nothing."""

    def ask(self, question: str) -> bool | None:  # noqa: ARG002
        """Nobody can answer."""
        return None

    def progress(self, text: str, done: int, total: int) -> None:
        """Show nothing."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Show nothing."""
