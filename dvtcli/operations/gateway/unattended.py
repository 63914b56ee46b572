"""Who is told what a gateway does, and is asked nothing: a client cannot wait for a person's answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results import BusEvent
    from dvtcli.operations.user.telling import Teller


class Unattended:
    """Hands everything on to *tell* but questions, and progress, which would be a client's."""

    def __init__(self, tell: Teller) -> None:
        self._tell = tell
        self.note, self.warning = tell.note, tell.warning

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
