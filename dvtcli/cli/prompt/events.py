"""What nodes say by themselves, in words. Does not know how it arrives or where it is shown."""

from __future__ import annotations

from dvtcli.domain.emergency_codes import emergency_text
from dvtcli.domain.node_events import BootUp, Emergency, NodeEvent


def event_text(event: NodeEvent) -> str:
    """An event on one line."""
    if isinstance(event, BootUp):
        return f"node {event.node_id}  boot-up: it has started"
    if isinstance(event, Emergency):
        maker = event.manufacturer.hex(" ").upper()
        text = f"0x{event.code:04X} {emergency_text(event.code)}"
        return f"node {event.node_id}  EMCY {text}  register 0x{event.register:02X}  {maker}"
    return f"node {event.node_id}  is {event.after.label}"
