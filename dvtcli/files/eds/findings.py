"""What the EDS/DCF reader has to say about a file.

Knows severities and lines. Does not know the file format, nor what a finding means for a device.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.profile import Severity

#: The rule of every finding that says "this section was not understood"; such sections are kept as raw text.
NOT_UNDERSTOOD = "section-not-understood"


@dataclass(frozen=True, slots=True)
class EdsFinding:
    """One oddity of a file: its *line* (1 and up), how bad it is, its short name *rule*, and what was done about it.

    *text* quotes the file as it is; a view must make control characters harmless.
    """

    line: int
    severity: Severity
    rule: str
    text: str


@dataclass(slots=True)
class Findings:
    """Collects findings while a file, or one object of it, is read."""

    found: list[EdsFinding] = field(default_factory=list)

    def error(self, line: int, rule: str, text: str) -> None:
        """The file says something that cannot be used."""
        self.found.append(EdsFinding(line, Severity.ERROR, rule, text))

    def warning(self, line: int, rule: str, text: str) -> None:
        """The file is wrong or incomplete, and was read in the likeliest way."""
        self.found.append(EdsFinding(line, Severity.WARNING, rule, text))

    def note(self, line: int, rule: str, text: str) -> None:
        """Worth knowing; nothing is wrong with what was read."""
        self.found.append(EdsFinding(line, Severity.NOTE, rule, text))

    def in_order(self) -> tuple[EdsFinding, ...]:
        """All findings by line, those about empty values as one note per key name."""
        empty = [finding for finding in self.found if finding.rule == "empty-value"]
        rest = [finding for finding in self.found if finding.rule != "empty-value"]
        return tuple(sorted([*rest, *_summarised(empty)], key=lambda finding: finding.line))


def _summarised(empty: list[EdsFinding]) -> list[EdsFinding]:
    """One note per key instead of hundreds: CiA 306 allows an empty value, it only says nothing."""
    lines: dict[str, list[int]] = {}
    for finding in empty:
        lines.setdefault(finding.text, []).append(finding.line)
    return [
        EdsFinding(min(at), Severity.NOTE, "empty-value", f"{len(at)} empty {key}, the first here: no value is known")
        for key, at in lines.items()
    ]
