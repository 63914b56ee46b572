"""What a word of the DVT brought. Does not know the words, nor how it is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.domain.rules import Finding


@dataclass(frozen=True, slots=True)
class WordResult:
    """What a word brought: its text, and what the rules said of it."""

    text: str = "OK"
    findings: tuple[Finding, ...] = ()
    #: the lines of a text of ours that has several
    rows: tuple[str, ...] = ()
