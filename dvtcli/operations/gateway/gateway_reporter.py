"""Who is told what a gateway does, and is asked nothing: a client cannot wait for a person's answer."""

from __future__ import annotations

from time import time
from typing import TYPE_CHECKING, Any

from dvtcli.operations.results.gateway_events import GatewayEvent

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results import BusEvent
    from dvtcli.operations.results.gateway_events import GatewayHappening
    from dvtcli.operations.user.reporter import Reporter


class GatewayReporter:
    """Hands what happens to *told*, or as text to *tell* where that is None; questions and progress to nobody.

    *client* is the name of the one whose line is done now, None for nobody's.
    """

    def __init__(self, tell: Reporter, told: Callable[[GatewayEvent], None] | None = None) -> None:
        self._tell, self._told = tell, told
        self.client: str | None = None

    def happened(self, event: GatewayHappening, text: Hint | str, **facts: Any) -> None:
        """Tell of an *event*; *facts* are further fields of it."""
        if self._told is not None:
            self._told(GatewayEvent(event, time(), text, **{"client": self.client, **facts}))
        elif event == "warning":
            self._tell.warning(text)
        else:
            self._tell.note(text)

    def note(self, text: Hint | str) -> None:
        """Hand it on."""
        self.happened("note", text)

    def warning(self, text: Hint | str) -> None:
        """Hand it on."""
        self.happened("warning", text)

    def bus(self, event: BusEvent) -> None:
        """Hand it on."""
        self._tell.bus(event)

    def instruct(self, text: str) -> None:
        """Hand it on."""
        self._tell.instruct(text)

    def ask(self, question: str) -> bool | None:  # noqa: ARG002
        """Nobody can answer."""
        return None

    def progress(self, text: str, done: int, total: int) -> None:
        """Show nothing."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Hand it on."""
        self._tell.traffic(frame, sent=sent, secret=secret)
