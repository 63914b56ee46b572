"""What the Python API tells while it works, and whom it asks: call-backs and the log `dvtcli`; nothing is printed."""

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
    """What a command would have said beside its result: a `note`, or a `warning` that nobody should miss."""

    kind: Literal["note", "warning"]
    text: str


class Told:
    """The Teller of a program: *on_message* and the log hear what a command would say; *ask_user* answers questions."""

    def __init__(
        self, on_message: Callable[[Message], None] | None = None, ask_user: Callable[[str], bool] | None = None
    ) -> None:
        self._on_message = on_message
        self._ask_user = ask_user

    def note(self, text: Hint | str) -> None:
        """Something good to know."""
        self._say("note", text, logging.INFO)

    def warning(self, text: Hint | str) -> None:
        """Something that nobody should miss."""
        self._say("warning", text, logging.WARNING)

    def bus(self, event: BusEvent) -> None:
        """A bus that is gone, or back."""
        self.warning(event.text)

    def instruct(self, text: str) -> None:
        """What has to be done by hand now, such as switching a node off and on."""
        self._say("warning", text, logging.WARNING)

    def _say(self, kind: Literal["note", "warning"], text: Hint | str, level: int) -> None:
        message = Message(kind, in_calls(text))
        in_callers_thread(lambda: self._hand_on(message, level))

    def _hand_on(self, message: Message, level: int) -> None:
        LOG.log(level, "%s", message.text)
        if self._on_message is not None:
            self._on_message(message)

    def ask(self, question: str) -> bool | None:
        """Whether the answer is yes; None where nobody is there to ask."""
        ask = self._ask_user
        return None if ask is None else in_callers_thread(lambda: bool(ask(question)))

    def progress(self, text: str, done: int, total: int) -> None:
        """Nothing: a program that wants it has *on_progress*."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Nothing: no call asks for traffic."""
