"""PDO parameters in the usual notation, by their keys in a network file."""

from __future__ import annotations

from typing import Any

from dvtcli.domain.pdo import Pdo, transmission_type_text


def entry_text(text: str) -> str:
    """A mapping entry as text; a dummy in its typed form."""
    return f"dummy/{text.rpartition('/')[2]}" if text.startswith("000") else text


def parameter_text(key: str, value: Any, pdo: Pdo) -> str:
    """A PDO parameter, by its key in a network file, in the usual notation."""
    if value is None:
        return "-"
    if key == "enabled":
        return "on" if value else "off"
    if key == "cob_id":
        return f"0x{value:03X}"
    if key == "type":
        return f"{value} {transmission_type_text(value, pdo.direction)}"
    if key == "inhibit_time":
        return f"{value / 10:g} ms"
    if key == "event_timer":
        return f"{value} ms"
    if key == "map":
        return " ".join(map(entry_text, value)) or "-"
    return str(value).lower() if isinstance(value, bool) else str(value)
