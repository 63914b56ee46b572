"""The result of `eds check`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol

from dvtcli.domain.text import join_some, plural
from dvtcli.errors import DvtcliError, UsageError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short

if TYPE_CHECKING:
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.lint import LintRule

#: From bad to harmless.
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, slots=True)
class FileRule(Short):
    """An applied rule: *name*, *severity*, meaning (*sense*), *source*."""

    name: str
    severity: str
    sense: str
    source: str


def rules_among(
    rules: Iterable[LintRule], only: Collection[str], without: Collection[str], about: str, page: str
) -> tuple[LintRule, ...]:
    """Return the *rules* in *only* (empty: all) except *without*; *page* documents all rules *about* this subject.

    Raises UsageError for an unknown name, or if no rule is left: what no rule looks at was not checked.
    """
    known = {rule.name: rule for rule in rules}
    for name in (*only, *without):
        if name not in known:
            from difflib import get_close_matches

            near = get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"{page} has them all"
            raise UsageError(f"unknown rule {name!r} about {about}", hint=hint)
    chosen = tuple(rule for name, rule in known.items() if name not in without and (not only or name in only))
    if not chosen:
        hint = "choose at least one rule"
        raise UsageError("no rule is left to check", given={"without": None}, hint=hint)
    return chosen


@dataclass(frozen=True, slots=True)
class FileFinding(Short):
    """A finding of *rule*: its line (1 and up), first and last *column*, 0 for none.

    *object* is printed as `6C01:01`, empty for the file as a whole. *hint* is what to do, None if nothing is known.
    """

    line: int
    severity: str
    rule: str
    object: str
    text: str
    column: int = 0
    end_column: int = 0
    hint: Hint | str | None = field(default=None, compare=False)

    def document(self) -> Document:
        """An element of `findings` in `dvtcli.eds/1`."""
        return {
            "line": self.line,
            "column": self.column or None,
            "end_column": self.end_column or None,
            "severity": self.severity,
            "rule": self.rule,
            "object": self.object or None,
            "text": self.text,
        }


class Judged:
    """A report with *findings*; *strict* treats warnings as errors."""

    __slots__ = ()
    findings: Sequence[FileFinding]
    strict: bool

    def is_bad(self, finding: FileFinding) -> bool:
        """Tell whether *finding* makes it invalid."""
        return finding.severity == "error" or (self.strict and finding.severity == "warning")

    def count(self) -> dict[str, int]:
        """Count findings by severity."""
        counted = Counter(finding.severity for finding in self.findings)
        return {severity: counted[severity] for severity in SEVERITIES}


@dataclass(frozen=True, slots=True)
class FileReport(Judged, Answer):
    """The result of `eds check`: sections in the file, sections understood, *rules* applied, findings by line.

    *strict* treats warnings as errors.
    """

    renderer: ClassVar = "check_lines:check_lines"
    formats: ClassVar = {
        "github": "github_lines:github_lines",
        "junit": "junit_lines:junit_lines",
        "sarif": "sarif_lines:sarif_lines",
    }
    use_pager: ClassVar = True
    made_by: ClassVar = "eds check"

    path: str
    sections: int
    understood: int
    objects: int
    rules: tuple[FileRule, ...]
    findings: tuple[FileFinding, ...]
    strict: bool = False

    @property
    def reports(self) -> tuple[FileReport, ...]:
        """Itself."""
        return (self,)

    def __bool__(self) -> bool:
        """Tell whether the file is valid."""
        return not self.exit_code

    @property
    def exit_code(self) -> int:
        """4 for an error among the findings."""
        return 4 if any(self.is_bad(finding) for finding in self.findings) else 0

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        return ended_with(4, wrong_reports(self.reports)) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.eds/1`."""
        return {"schema": "dvtcli.eds/1", **self.fields()}

    def fields(self) -> Document:
        """The document's fields about the file."""
        return {
            "file": self.path,
            "sections": self.sections,
            "understood": self.understood,
            "objects": self.objects,
            "strict": self.strict,
            "rules": len(self.rules),
            "count": self.count(),
            "findings": [finding.document() for finding in self.findings],
        }


@dataclass(frozen=True, slots=True)
class FileReports(Answer):
    """Reports of several *files*, checked by the same rules."""

    renderer: ClassVar = "check_lines:checks_lines"
    formats: ClassVar = FileReport.formats
    use_pager: ClassVar = True

    files: tuple[FileReport, ...]

    @property
    def reports(self) -> tuple[FileReport, ...]:
        """A report per file."""
        return self.files

    def __bool__(self) -> bool:
        """Tell whether all files are valid."""
        return not self.exit_code

    @property
    def exit_code(self) -> int:
        """4 for an error in any file."""
        return max(file.exit_code for file in self.files)

    def count(self) -> dict[str, int]:
        """Count findings of all files by severity."""
        counted = [file.count() for file in self.files]
        return {severity: sum(file_counts[severity] for file_counts in counted) for severity in SEVERITIES}

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        return ended_with(4, wrong_reports(self.reports)) if self.exit_code else None

    def document(self) -> Document:
        """`dvtcli.eds-files/1`."""
        bad = sum(1 for file in self.files if file.exit_code)
        return {
            "schema": "dvtcli.eds-files/1",
            "bad": bad,
            "count": self.count(),
            "files": [file.fields() for file in self.files],
        }


def wrong_reports(reports: Sequence[Report]) -> str:
    """Name the invalid *reports* and their number of findings."""
    counted = ((report.path, sum(map(report.is_bad, report.findings))) for report in reports)
    return join_some([f"{path} has {plural(count, 'finding')}" for path, count in counted if count])


class Report(Protocol):
    """The findings of rules for a file or bus, *path*; *made_by* is the command."""

    made_by: ClassVar[str]

    @property
    def path(self) -> str:
        """The file or bus."""
        ...

    @property
    def rules(self) -> tuple[FileRule, ...]:
        """The applied rules."""
        ...

    @property
    def findings(self) -> tuple[FileFinding, ...]:
        """Their findings."""
        ...

    def is_bad(self, finding: FileFinding) -> bool:
        """Tell whether *finding* makes it invalid."""
        ...

    def count(self) -> dict[str, int]:
        """Count findings by severity."""
        ...


class Reported(Protocol):
    """A result with reports."""

    @property
    def reports(self) -> Sequence[Report]:
        """A report per file or bus."""
        ...
