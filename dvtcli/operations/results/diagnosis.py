"""The result of `doctor`, check by check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from dvtcli.domain.hint import Hint, next_step
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short

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

    renderer: ClassVar = "fact_lines:diagnosis_lines"

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
