"""What happens at a gateway, as an answer of whoever serves it. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dvtcli.domain.hint import Hint
from dvtcli.domain.wall_clock import utc
from dvtcli.operations.results.documents import Document, Short

GatewayHappening = Literal["connected", "left", "written", "nmt", "note", "warning"]


@dataclass(frozen=True, slots=True)
class GatewayEvent(Short):
    """What happened at *time_s* (s since 1970), in words as *text*; *client* is whose doing it was, None for nobody's.

    Of a write *node*, *object* and *data* (hexadecimal) say what; *data* is None where it is a passcode.
    """

    event: GatewayHappening
    time_s: float
    text: Hint | str
    client: str | None = None
    node: int | None = None
    object: str | None = None
    data: str | None = None

    def document(self) -> Document:
        """`dvtcli.gateway-event/1`."""
        return {
            "schema": "dvtcli.gateway-event/1",
            "time": utc(self.time_s),
            "event": self.event,
            "client": self.client,
            "node": self.node,
            "object": self.object,
            "data": self.data,
            "text": self.text,
        }
