"""What `doctor` found, check by check. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from dvtcli.domain.hint import Hint, next_step
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Short

Verdict = Literal["ok", "warn", "FAIL"]


@dataclass(frozen=True, slots=True)
class Check(Short):
    """One look at the set-up; *hint* is the next step where *verdict* is not ok, *code* a failure's exit code."""

    name: str
    verdict: Verdict
    text: str
    hint: Hint | str | None = None
    code: int = 1

    def document(self) -> Document:
        """One check of `dvtcli.doctor/1`."""
        return {
            "check": self.name,
            "verdict": self.verdict.lower(),
            "text": self.text,
            "hint": self.hint,
            "next": next_step(self.hint),
        }


@dataclass(frozen=True, slots=True)
class Diagnosis(Answer):
    """Every check, in the order in which one needs the other."""

    renderer: ClassVar = "diagnosis_lines:diagnosis_lines"

    checks: tuple[Check, ...]

    @property
    def exit_code(self) -> int:
        """0, or that of the first check that failed."""
        return next((check.code for check in self.checks if check.verdict == "FAIL"), 0)

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """What a program is told where the exit code is not 0."""
        failed = next((check for check in self.checks if check.verdict == "FAIL"), None)
        return None if failed is None else ended_with(failed.code, f"{failed.name}: {failed.text}", hint=failed.hint)

    def document(self) -> Document:
        """`dvtcli.doctor/1`."""
        return {
            "schema": "dvtcli.doctor/1",
            "healthy": self.exit_code == 0,
            "checks": [check.document() for check in self.checks],
        }
