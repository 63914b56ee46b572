"""Findings: what our rules say about a wanted configuration before anything is written."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.profile import Severity


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing a rule noticed.

    *rule* is its short name, *place* an object (`0x1A00:03`) or `FILE:LINE`, *abort* the SDO abort code the
    device would give, or None.
    """

    rule: str
    severity: Severity
    place: str
    text: str
    abort: int | None = None
    hint: str | None = None
