"""Plain facts, and the checks of `doctor`, as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from dvtcli.domain.hint import Hint, next_step
from dvtcli.domain.rules.finding import Finding
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short, finding_document


@dataclass(frozen=True, slots=True)
class DvtAnswer(Answer):
    """The answer to *word*: `OK`, a value, `Abort 0x…` or `Timeout`; *reasons* say why, most important first.

    *dry_run*: the node's twin answered; *rows* are the lines of a longer answer.
    """

    renderer: ClassVar = "node_lines:answer_lines"
    show_findings: ClassVar = True

    word: str
    node: int | None
    answer: str
    reasons: tuple[Hint | str, ...] = ()
    exit_code: int = 0
    findings: tuple[Finding, ...] = ()
    dry_run: bool = False
    rows: tuple[str, ...] = ()

    @property
    def remark(self) -> str:
        """The remark under --dry-run: a twin answered."""
        return "dry run: the node's twin answered; nothing was written to the bus" if self.dry_run else ""

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


@dataclass(frozen=True, slots=True)
class Facts(Answer):
    """Labelled lines about what was done or found."""

    use_pager: ClassVar = True
    show_findings: ClassVar = True

    schema: str
    rows: tuple[tuple[str, Any], ...]
    text: tuple[Hint | str, ...]
    #: why the command does not end with 0, for documents; the text says it, too
    failure_of_document: DvtcliError | None = None
    #: warnings and notes
    findings: tuple[Finding, ...] = ()
    #: whether certainly no node was written to, if the command may do so
    changed_nothing: bool = False

    @property
    def exit_code(self) -> int:
        """0, or the code of the failure."""
        return 0 if self.failure_of_document is None else self.failure_of_document.exit_code

    def document(self) -> Document:
        """The rows under the result's own schema."""
        document: Document = {"schema": f"dvtcli.{self.schema}/1", **dict(self.rows)}
        if self.findings:
            document["findings"] = [finding_document(finding) for finding in self.findings]
        return document


Verdict = Literal["ok", "warn", "FAIL"]


@dataclass(frozen=True, slots=True)
class Check(Short):
    """A check of the set-up; *hint* is the next step unless *verdict* is ok, *code* a failure's exit code."""

    name: str
    verdict: Verdict
    text: str
    hint: Hint | str | None = None
    code: int = 1

    def document(self) -> Document:
        """A check in `dvtcli.doctor/1`."""
        return {
            "check": self.name,
            "verdict": self.verdict.lower(),
            "text": self.text,
            "hint": self.hint,
            "next": next_step(self.hint),
        }


@dataclass(frozen=True, slots=True)
class Diagnosis(Answer):
    """Every check, prerequisites first."""

    renderer: ClassVar = "node_lines:diagnosis_lines"

    checks: tuple[Check, ...]

    @property
    def exit_code(self) -> int:
        """0, or the exit code of the first failed check."""
        return next((check.code for check in self.checks if check.verdict == "FAIL"), 0)

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        failed = next((check for check in self.checks if check.verdict == "FAIL"), None)
        return None if failed is None else ended_with(failed.code, f"{failed.name}: {failed.text}", hint=failed.hint)

    def document(self) -> Document:
        """`dvtcli.doctor/1`."""
        return {
            "schema": "dvtcli.doctor/1",
            "healthy": self.exit_code == 0,
            "checks": [check.document() for check in self.checks],
        }
