"""What the EDS/DCF reader has to say about a file.

Knows lines. Does not know the file format, nor what a finding means for a device.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.lint.lint_rule import LintRule
from dvtcli.domain.profile import Severity
from dvtcli.files.eds.read_rules import EMPTY_VALUE


@dataclass(frozen=True, slots=True)
class EdsFinding:
    """One oddity of a file: its *line* (1 and up), how bad it is, its short name *rule*, and what was done about it.

    *text* quotes the file as it is; a view must make control characters harmless. *object* is the one that it is
    about, as it is printed (`6C01:01`), empty where it is about none or where nobody has looked it up. With
    *value_lost* it is a ParameterValue (actualValue) that could not be read: nobody knows what the file wants there.
    With *value_unread* a value stands there that is for no object, or is said twice alike: nothing is wanted by it.
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
    """Collects findings while a file, or one object of it, is read."""

    found: list[EdsFinding] = field(default_factory=list)

    def add(
        self, rule: LintRule, line: int, text: str, *, value_lost: bool = False, value_unread: bool = False
    ) -> None:
        """Keep that *rule* was met in *line*; *text* says how, and what was done about it."""
        self.found.append(EdsFinding(line, rule.severity, rule.name, text, "", value_lost, value_unread))

    def in_order(self) -> tuple[EdsFinding, ...]:
        """All findings by line, those about empty values as one note per key name."""
        empty = [finding for finding in self.found if finding.rule == EMPTY_VALUE.name]
        rest = [finding for finding in self.found if finding.rule != EMPTY_VALUE.name]
        return tuple(sorted([*rest, *_summarised(empty)], key=lambda finding: finding.line))


def _summarised(empty: list[EdsFinding]) -> list[EdsFinding]:
    """One note per key instead of hundreds: CiA 306 allows an empty value, it only says nothing."""
    lines: dict[str, list[int]] = {}
    for finding in empty:
        lines.setdefault(finding.text, []).append(finding.line)
    return [
        EdsFinding(
            min(at), EMPTY_VALUE.severity, EMPTY_VALUE.name, f"{len(at)} empty {key}, the first here: no value is known"
        )
        for key, at in lines.items()
    ]
