"""Findings of the EDS/DCF reader about a file, by line."""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.lint.lint_rule import LintRule
from dvtcli.domain.profile import Severity
from dvtcli.files.eds.read_rules import EMPTY_VALUE


@dataclass(frozen=True, slots=True)
class EdsFinding:
    """An oddity of a file: *line* (from 1), severity, *rule* by its short name, and *text* with the reader's reaction.

    *text* quotes the file unchanged; a view must make control characters harmless. *object* is the object concerned in
    printed form (`6C01:01`), empty if none or not yet looked up. *value_lost*: a ParameterValue (actualValue) could not
    be
    read, so the wanted value is unknown. *value_unread*: a value belongs to no object, or is repeated, and has no
    effect.
    """

    line: int
    severity: Severity
    rule: str
    text: str
    object: str = ""
    value_lost: bool = False
    value_unread: bool = False


@dataclass(slots=True)
class Findings:
    """Findings collected while a file, or a single object, is read."""

    found: list[EdsFinding] = field(default_factory=list)

    def add(
        self, rule: LintRule, line: int, text: str, *, value_lost: bool = False, value_unread: bool = False
    ) -> None:
        """Record a finding of *rule* in *line*; *text* has the details and the reader's reaction."""
        self.found.append(EdsFinding(line, rule.severity, rule.name, text, "", value_lost, value_unread))

    def in_order(self) -> tuple[EdsFinding, ...]:
        """Return all findings by line, with one note per key name for empty values."""
        empty = [finding for finding in self.found if finding.rule == EMPTY_VALUE.name]
        rest = [finding for finding in self.found if finding.rule != EMPTY_VALUE.name]
        return tuple(sorted([*rest, *_summarised(empty)], key=lambda finding: finding.line))


def _summarised(empty: list[EdsFinding]) -> list[EdsFinding]:
    """Replace hundreds of notes by one per key: CiA 306 allows an empty value without meaning."""
    lines: dict[str, list[int]] = {}
    for finding in empty:
        lines.setdefault(finding.text, []).append(finding.line)
    return [
        EdsFinding(
            min(at), EMPTY_VALUE.severity, EMPTY_VALUE.name, f"{len(at)} empty {key}, the first here: no value is known"
        )
        for key, at in lines.items()
    ]
