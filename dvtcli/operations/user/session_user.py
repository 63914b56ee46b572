"""The user's part of a session, for operations that need neither its bus nor its nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from dvtcli.operations.user.options import NO_TERMINAL

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from pathlib import Path

    from dvtcli.device.cancellation import Cancellation
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.frames import BusEvent
    from dvtcli.operations.user.options import Options
    from dvtcli.operations.user.secret_objects import Secrets
    from dvtcli.operations.user.settings import Settings


class SessionUser(Protocol):
    """Options, messages and questions of a session, as `Opened` has them."""

    @property
    def reporter(self) -> Reporter:
        """Messages to the user."""

    @property
    def base(self) -> Options:
        """The options of the session, without those of a line."""

    @property
    def options(self) -> Options:
        """The options in force."""

    @property
    def dry_run(self) -> bool:
        """Whether writes go to twins."""

    @property
    def in_script(self) -> bool:
        """Whether lines run one after another, unattended."""

    @property
    def cancellation(self) -> Cancellation:
        """The user's Ctrl-C, obeyed at safe points."""

    @property
    def settings(self) -> Settings:
        """The settings at the start of the program."""

    @property
    def secrets(self) -> Secrets:
        """The passcodes to hide."""

    @property
    def state_folder(self) -> Path:
        """The folder of journals, locks and backups."""

    @property
    def made(self) -> list[str]:
        """Files made by the current line, as named."""

    def require_settings(self) -> None:
        """See `Opened.require_settings`."""

    def chosen_by(self) -> str:
        """See `Opened.chosen_by`."""

    def doing(self) -> str:
        """See `Opened.doing`."""

    def consent(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """See `Opened.consent`."""

    def consent_anew(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """See `Opened.consent_anew`."""

    def require_yes(self, question: str, node_id: int | None, hint: Hint, refused: str = "not done") -> None:
        """See `Opened.require_yes`."""

    def require_typed(self, question: str, word: str, node_id: int, hint: Hint) -> None:
        """See `Opened.require_typed`."""

    def agreed(self) -> AbstractContextManager[None]:
        """See `Opened.agreed`."""


class Reporter(Protocol):
    """A receiver of messages: a screen, a test bench's log, or nothing."""

    @property
    def unanswered(self) -> str:
        """Why `ask` returns None, in words."""
        ...

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

    unanswered = NO_TERMINAL

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
