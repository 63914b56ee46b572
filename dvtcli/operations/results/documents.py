"""What every answer can do, and how values become JSON. Knows no terminal and no session."""

from __future__ import annotations

import math
from typing import Any, Protocol

from dvtcli.domain.datatypes import CanopenTime, Value
from dvtcli.domain.rules import Finding

Document = dict[str, Any]


class Result(Protocol):
    """What every command's answer can do."""

    @property
    def exit_code(self) -> int:
        """0, or 3 where differences exist."""
        ...

    def document(self) -> Document:
        """The answer as one JSON document."""
        ...


def hex_bytes(data: bytes | None) -> str | None:
    """Bytes as documents carry them: `01 02 00 00`, in the order of the wire."""
    return None if data is None else data.hex(" ").upper()


def json_value(value: Value) -> Any:
    """A value as JSON can carry it: bytes as hex, times as two numbers, `"nan"` and `"inf"` as text."""
    if isinstance(value, bytes):
        return hex_bytes(value)
    if isinstance(value, CanopenTime):
        return {"days": value.days, "milliseconds": value.milliseconds}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def finding_document(finding: Finding) -> Document:
    """A finding as JSON."""
    return {
        "rule": finding.rule,
        "severity": str(finding.severity),
        "place": finding.place,
        "text": finding.text,
        "abort": None if finding.abort is None else f"0x{finding.abort:08X}",
        "hint": finding.hint,
    }
