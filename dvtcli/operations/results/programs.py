"""A program that was loaded into a device, as an answer. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document


@dataclass(frozen=True, slots=True)
class ProgramLoaded(Answer):
    """A program of *size* bytes from *file* that runs as program *number* of *node*; under *dry_run* nothing was sent.

    *before* and *after* are what 0x1F56 said of the old and of the new one, None where the device does not say;
    *expected* is what it was compared with, None for nothing, *expected_by* the profile that says so, empty where the
    user did. *restarted*: its boot-up message was heard.
    """

    renderer: ClassVar = "program_lines:program_lines"

    node: int
    number: int
    file: str
    size: int
    before: int | None = None
    after: int | None = None
    expected: int | None = None
    expected_by: str = ""
    restarted: bool = False
    seconds: float = 0.0
    dry_run: bool = False
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.program/1`."""
        return {
            "schema": "dvtcli.program/1",
            "node": self.node,
            "program": self.number,
            "file": self.file,
            "bytes": self.size,
            "identification_before": self.before,
            "identification": self.after,
            "expected": self.expected,
            "expected_by": self.expected_by or None,
            "restarted": self.restarted,
            "seconds": round(self.seconds, 3),
            "dry_run": self.dry_run,
        }
