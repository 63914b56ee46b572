"""The user's part of a session, for operations that need neither its bus nor its nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from pathlib import Path

    from dvtcli.device.cancellation import Cancellation
    from dvtcli.domain.hint import Hint
    from dvtcli.operations.user.options import Options
    from dvtcli.operations.user.reporter import Reporter
    from dvtcli.operations.user.secret_objects import Secrets
    from dvtcli.operations.user.settings import Settings


class SessionUser(Protocol):
    """Options, messages and questions of a session, as `Opened` has them."""

    @property
    def tell(self) -> Reporter:
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
