"""What the user has said and can be asked: the options that count, who listens, what may be shown to nobody.

Does not know whether a bus is open.
"""

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
    """A session as far as its user goes: *options* count from the beginning, *tell* hears what the user should know."""

    def __init__(self, options: Options | None = None, tell: Reporter | None = None) -> None:
        self.tell = tell or _nobody()
        self.base = self.options = options or Options()
        self.cancellation = Cancellation()
        self._agreed = False

    @cached_property
    def settings(self) -> Settings:
        """Everything that was said at the program's start, in options, variables and files."""
        from dvtcli.operations.user.settings import Settings

        return Settings()

    def require_settings(self) -> None:
        """Raise what is wrong with the settings; what a project's file says in vain, or first, is said once."""
        for said in self.settings.required():
            self.tell.warning(str(said))

    def chosen_by(self) -> str:
        """Who chose the bus: an option, a variable or a file, for people."""
        return self.settings.chosen_by()

    @property
    def in_script(self) -> bool:
        """Whether lines follow one another, with nobody to look at each answer."""
        return False

    @property
    def dry_run(self) -> bool:
        """Whether writes go to a twin."""
        return self.options.dry_run

    def doing(self) -> str:
        """What is being done, for another dvtcli that waits for a node: nothing that has a name."""
        return ""

    def consent(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """Ask *question*, about one node if *node_id* is given, if somebody can answer; a callable makes it up then.

        Returns on yes, raises SafetyRefusal otherwise.
        """
        if not self._agreed:
            self.consent_anew(question, node_id)

    def consent_anew(self, question: str | Callable[[], str], node_id: int | None = None) -> None:
        """The same, of what no question before it named: it is asked also in the middle of what was agreed to."""
        if not (self.options.yes or self.dry_run):
            from dvtcli.domain.hint import Action, Hint

            text = question if isinstance(question, str) else question()
            self.require_yes(text, node_id, Hint(Action.AGREE, why="give {} to answer yes"))

    def require_yes(self, question: str, node_id: int | None, hint: Hint, refused: str = "not done") -> None:
        """Ask *question*, which no option answers; SafetyRefusal if the answer is no, or with *hint* if nobody answers.

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
        """A block in which nothing is asked: all of it was consented to, or takes back what was."""
        self._agreed = True
        try:
            yield
        finally:
            self._agreed = False

    @property
    def state_folder(self) -> Path:
        """Where journals, locks and backups are kept."""
        from dvtcli.operations.user.keeping import state_folder

        return state_folder(self.options)

    @cached_property
    def secrets(self) -> Secrets:
        """What no screen and no file may show: passcodes on the wire and in lines."""
        from dvtcli.operations.user.secret_objects import Secrets

        return Secrets.known()


def _nobody() -> Reporter:
    from dvtcli.operations.user.reporter import NullReporter

    return NullReporter()
