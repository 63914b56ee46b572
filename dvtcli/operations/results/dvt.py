"""The answer of one of the DVT's words. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.rules import Finding
from dvtcli.operations.results.documents import Document, finding_document


@dataclass(frozen=True, slots=True)
class DvtAnswer:
    """What *word* answered: `OK`, a value, `Abort 0x…` or `Timeout`; *reasons* say why, what first.

    *dry_run* says that the node's twin answered.
    """

    word: str
    node: int | None
    answer: str
    reasons: tuple[str, ...] = ()
    exit_code: int = 0
    findings: tuple[Finding, ...] = ()
    dry_run: bool = False

    def document(self) -> Document:
        """`dvtcli.dvt/1`."""
        return {
            "schema": "dvtcli.dvt/1",
            "word": self.word,
            "node": self.node,
            "answer": self.answer,
            "reasons": list(self.reasons),
            "findings": [finding_document(finding) for finding in self.findings],
            "dry_run": self.dry_run,
        }
