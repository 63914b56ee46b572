"""Changes, stores and comparisons as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.plan import PdoChange, Plan
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules import Finding
from dvtcli.results.documents import Document, finding_document, hex_bytes


@dataclass(frozen=True, slots=True)
class Changed:
    """A plan that was carried out and read back."""

    node: int
    plan: Plan
    findings: tuple[Finding, ...]
    dry_run: bool
    seconds: float
    undone: bool = False
    #: whether anything of it is lost at power-off unless it is stored
    volatile: bool = True
    #: what makes it last, in words
    keep: str = "`store` keeps it"
    names: dict[str, str] = field(default_factory=dict)
    exit_code: int = 0
    #: whether it was the family's way to keep its settings
    saved: bool = False

    def document(self) -> Document:
        """`dvtcli.change/1`."""
        pdos = [str(change.pdo) for change in self.plan.changes if isinstance(change, PdoChange)]
        steps = [
            {
                "object": step.object,
                "before": hex_bytes(step.before),
                "after": hex_bytes(step.after),
                "reason": step.reason,
            }
            for step in self.plan.steps
        ]
        return {
            "schema": "dvtcli.change/1",
            "node": self.node,
            "pdo": pdos[0] if len(pdos) == 1 else None,
            "pdos": pdos,
            "steps": steps,
            "writes": len(steps),
            "verified": True,
            "stored": self.saved,
            "dry_run": self.dry_run,
            "findings": [finding_document(finding) for finding in self.findings],
        }


@dataclass(frozen=True, slots=True)
class Stored:
    """A store or restore that the device took; *proved* lists the PDOs read back after a reset."""

    node: int
    object: str
    word: str
    seconds: float
    limit_s: float
    changed: tuple[str, ...]
    dry_run: bool
    proved: int | None = None
    differences: tuple[str, ...] = ()
    reset: str | None = None

    @property
    def exit_code(self) -> int:
        """1 where the reset showed that the device did not keep everything."""
        return 1 if self.differences else 0

    def document(self) -> Document:
        """`dvtcli.store/1`."""
        return {
            "schema": "dvtcli.store/1",
            "node": self.node,
            "object": self.object,
            "action": self.word,
            "seconds": round(self.seconds, 3),
            "changed": list(self.changed),
            "stored": self.word == "store" and not self.differences,
            "proved": None if self.proved is None else not self.differences,
            "differences": list(self.differences),
            "dry_run": self.dry_run,
        }


@dataclass(frozen=True, slots=True)
class Compared:
    """A read-back against what was wanted: one row a PDO that differs."""

    node: int
    pdos: int
    parameters: int
    differences: tuple[tuple[str, str], ...] = ()
    against: str = "this session's changes"
    frames: tuple[tuple[str, Frame | None, float], ...] = ()
    state_note: str = ""

    @property
    def exit_code(self) -> int:
        """3 where something differs."""
        return 3 if self.differences else 0

    def document(self) -> Document:
        """`dvtcli.verify/1`."""
        return {
            "schema": "dvtcli.verify/1",
            "node": self.node,
            "pdos": self.pdos,
            "parameters": self.parameters,
            "equal": not self.differences,
            "differences": [{"pdo": pdo.lower(), "text": text} for pdo, text in self.differences],
            "frames": [
                {"pdo": pdo.lower(), "data": None if frame is None else hex_bytes(frame.data), "ms": round(ms, 1)}
                for pdo, frame, ms in self.frames
            ],
        }
