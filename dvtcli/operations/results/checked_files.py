"""What `eds check` answers. Knows no terminal and no file format."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document

#: From bad to harmless.
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, slots=True)
class FileRule:
    """A rule that was asked: its *name* and *severity*, what it says (*sense*), and who says so (*source*)."""

    name: str
    severity: str
    sense: str
    source: str


@dataclass(frozen=True, slots=True)
class FileFinding:
    """Something that *rule* found in a file, with its line (1 and up).

    *object* as it is printed (`6C01:01`), empty for the file as a whole.
    """

    line: int
    severity: str
    rule: str
    object: str
    text: str


@dataclass(frozen=True, slots=True)
class FileReport(Answer):
    """What `eds check` found: sections in the file, sections understood, the *rules* asked, and findings by line.

    With *strict* a warning is as bad as an error.
    """

    renderer: ClassVar = "check_lines:check_lines"
    formats: ClassVar = {
        "github": "github_lines:github_lines",
        "junit": "junit_lines:junit_lines",
        "sarif": "sarif_lines:sarif_lines",
    }
    at_leisure: ClassVar = True

    path: str
    sections: int
    understood: int
    objects: int
    rules: tuple[FileRule, ...]
    findings: tuple[FileFinding, ...]
    strict: bool = False

    @property
    def exit_code(self) -> int:
        """4 where a finding is bad enough."""
        return 4 if any(self.is_bad(finding) for finding in self.findings) else 0

    def is_bad(self, finding: FileFinding) -> bool:
        """Whether *finding* makes the file invalid."""
        return finding.severity == "error" or (self.strict and finding.severity == "warning")

    def count(self) -> dict[str, int]:
        """How many findings of each severity."""
        counted = Counter(finding.severity for finding in self.findings)
        return {severity: counted[severity] for severity in SEVERITIES}

    def document(self) -> Document:
        """`dvtcli.eds/1`."""
        findings = [
            {"line": f.line, "severity": f.severity, "rule": f.rule, "object": f.object or None, "text": f.text}
            for f in self.findings
        ]
        return {
            "schema": "dvtcli.eds/1",
            "file": self.path,
            "sections": self.sections,
            "understood": self.understood,
            "objects": self.objects,
            "strict": self.strict,
            "rules": len(self.rules),
            "count": self.count(),
            "findings": findings,
        }
