"""The result of a DVT word."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.domain.rules import Finding


@dataclass(frozen=True, slots=True)
class WordResult:
    """The result of a word: its text, and findings of rules."""

    text: str = "OK"
    findings: tuple[Finding, ...] = ()
    #: the lines of a text with several
    rows: tuple[str, ...] = ()
