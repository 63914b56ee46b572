"""A lost or returned bus as a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from dvtcli.domain.hint import Hint
from dvtcli.domain.times import local_clock, utc
from dvtcli.operations.results.documents import Answer, Document, Short

GatewayHappening = Literal["connected", "left", "written", "nmt", "note", "warning"]


@dataclass(frozen=True, slots=True)
class GatewayEvent(Short):
    """An event at *time_s* (s since 1970), in words as *text*; *client* caused it, None for nobody.

    A write has *node*, *object* and *data* (hexadecimal); *data* is None for a passcode.
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


@dataclass(frozen=True, slots=True)
class BusEvent(Answer):
    """The *bus* by its name is gone, and *why*, or is back after *after_s* seconds; at *time_s* (s since 1970)."""

    renderer: ClassVar = "frame_lines:bus_event_lines"

    bus: str
    time_s: float
    why: str = ""
    after_s: float | None = None
    exit_code: int = 0

    @property
    def text(self) -> str:
        """The event in a line, with the time of day."""
        if self.after_s is None:
            said = f"is gone ({self.why}): waiting for it"
        else:
            said = f"is back after {self.after_s:.1f} s"
        return f"{local_clock(self.time_s)}  {self.bus} {said}"

    def document(self) -> Document:
        """`dvtcli.bus/1`."""
        return {
            "schema": "dvtcli.bus/1",
            "time": utc(self.time_s),
            "bus": self.bus,
            "event": "gone" if self.after_s is None else "back",
            "why": self.why or None,
            "after_s": None if self.after_s is None else round(self.after_s, 3),
        }
