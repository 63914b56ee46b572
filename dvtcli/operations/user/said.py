"""The user of a session: options, reporter, consent, secrets."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

from dvtcli.device.cancellation import Cancellation
from dvtcli.errors import SafetyRefusal
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dvtcli.domain.hint import Hint
    from dvtcli.operations.user.reporter import Reporter
    from dvtcli.operations.user.secret_objects import Secrets
    from dvtcli.operations.user.settings import Settings


class SessionOptions:
    """The user's part of a session: initial *options*, and *tell* for messages."""

    def __init__(self, options: Options | None = None, tell: Reporter | None = None) -> None:
        self.tell = tell or _nobody()
        self.base = self.options = options or Options()
        self.cancellation = Cancellation()
        self._agreed = False

    @cached_property
    def settings(self) -> Settings:
        """All settings at the start of a program: options, variables and files."""
        from dvtcli.operations.user.settings import Settings

        return Settings()

    def require_settings(self) -> None:
        """Raise errors of the settings; reports a project file's ignored keys, or first use, once."""
        for said in self.settings.required():
            self.tell.warning(str(said))

    def chosen_by(self) -> str:
        """Describe what chose the bus: option, variable or file."""
        return self.settings.chosen_by()

    @property
    def in_script(self) -> bool:
        """Tell whether lines run one after another, unattended."""
        return False

    @property
    def dry_run(self) -> bool:
        """Tell whether writes go to twins."""
        return self.options.dry_run

    def doing(self) -> str:
        """Describe the current work for another dvtcli that waits for a node; here without a name."""
        return ""

    def consent(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """Ask *question* (or its result if callable), about a node if given, if somebody can answer.

        Returns on yes, else raises SafetyRefusal.
        """
        if not self._agreed:
            self.consent_anew(question, node_id)

    def consent_anew(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """Ask even inside `agreed`, for what no earlier question named."""
        if not (self.options.yes or self.dry_run):
            from dvtcli.domain.hint import Action, Hint

            text = question if isinstance(question, str) else question()
            self.require_yes(text, node_id, Hint(Action.AGREE, why="give {} to answer yes"))

    def require_yes(self, question: str, node_id: int | None, hint: Hint, refused: str = "not done") -> None:
        """Ask *question*, ignoring --yes; raises SafetyRefusal on no, or with *hint* if nobody can answer.

        *refused* says what did not happen.
        """
        with self.cancellation.released():  # Ctrl-C here is a no to everything that the question was for
            answer = self.tell.ask(question)
        if answer is None:
            raise SafetyRefusal(f"nobody can answer: {question}", node=node_id, hint=hint)
        if not answer:
            raise SafetyRefusal(f"{refused}: the answer was no", node=node_id)

    @contextmanager
    def agreed(self) -> Iterator[None]:
        """Suppress questions in a block: it was consented to, or rolls back."""
        self._agreed = True
        try:
            yield
        finally:
            self._agreed = False

    @property
    def state_folder(self) -> Path:
        """Return the folder of journals, locks and backups."""
        from dvtcli.operations.user.keeping import state_folder

        return state_folder(self.options)

    @cached_property
    def secrets(self) -> Secrets:
        """The passcodes to hide, on the bus and in lines."""
        from dvtcli.operations.user.secret_objects import Secrets

        return Secrets.known()


def _nobody() -> Reporter:
    from dvtcli.operations.user.reporter import NullReporter

    return NullReporter()
