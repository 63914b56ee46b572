"""The messages and questions of the Python API: call-backs and the log `dvtcli`; nothing is printed."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from dvtcli.bus.turns import in_callers_thread
from dvtcli.operations.api.called_hints import in_calls

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.bus_events import BusEvent

LOG = logging.getLogger("dvtcli")
LOG.addHandler(logging.NullHandler())


@dataclass(frozen=True, slots=True)
class Message:
    """A message of a command beside its result: a `note`, or a `warning`."""

    kind: Literal["note", "warning"]
    text: str


class Told:
    """The reporter of a program: *on_message* and the log get messages; *ask_user* gets questions."""

    def __init__(
        self, on_message: Callable[[Message], None] | None = None, ask_user: Callable[[str], bool] | None = None
    ) -> None:
        self._on_message = on_message
        self._ask_user = ask_user

    def note(self, text: Hint | str) -> None:
        """Something good to know."""
        self._say("note", text, logging.INFO)

    def warning(self, text: Hint | str) -> None:
        """Report a warning."""
        self._say("warning", text, logging.WARNING)

    def bus(self, event: BusEvent) -> None:
        """Report a lost or returned bus."""
        self.warning(event.text)

    def instruct(self, text: str) -> None:
        """Report what to do by hand now, such as switching a node off and on."""
        self._say("warning", text, logging.WARNING)

    def _say(self, kind: Literal["note", "warning"], text: Hint | str, level: int) -> None:
        message = Message(kind, in_calls(text))
        in_callers_thread(lambda: self._hand_on(message, level))

    def _hand_on(self, message: Message, level: int) -> None:
        LOG.log(level, "%s", message.text)
        if self._on_message is not None:
            self._on_message(message)

    def ask(self, question: str) -> bool | None:
        """Ask; None if nobody can answer."""
        ask = self._ask_user
        return None if ask is None else in_callers_thread(lambda: bool(ask(question)))

    def confirm(self, question: str, word: str) -> bool | None:  # noqa: ARG002
        """Ask; the function of a program is told the question, and types nothing."""
        return self.ask(question)

    def progress(self, text: str, done: int, total: int) -> None:
        """Ignore it: a program has *on_progress*."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Nothing: no call asks for traffic."""
