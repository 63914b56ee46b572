"""Who produces SYNC, as an answer. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.rules import Finding
from dvtcli.operations.results.documents import Answer, Document, Short, finding_document

#: Bit 30 of 0x1005: this node produces SYNC.
_PRODUCES = 1 << 30


@dataclass(frozen=True, slots=True)
class SyncSource(Short):
    """What one node says of SYNC: *cob_id* is its 0x1005, *period_us* its 0x1006; None where it has no such object."""

    node: int
    cob_id: int | None
    period_us: int | None

    @property
    def produces(self) -> bool:
        """Whether it says that it produces SYNC."""
        return bool(self.cob_id is not None and self.cob_id & _PRODUCES and self.period_us)

    @property
    def can_id(self) -> int:
        """The CAN-ID that it takes for SYNC."""
        return 0x080 if self.cob_id is None else self.cob_id & 0x1FFF_FFFF


@dataclass(frozen=True, slots=True)
class SyncCheck(Answer):
    """Whether anybody produces SYNC: what nodes say, and how many were *heard* within *listened_ms*; true if so."""

    renderer: ClassVar = "node_lines:sync_check_lines"
    at_leisure: ClassVar = True
    remarked: ClassVar = True

    nodes: tuple[SyncSource, ...]
    heard: int
    listened_ms: int
    findings: tuple[Finding, ...] = ()
    exit_code: int = 0

    def __bool__(self) -> bool:
        return self.produced

    @property
    def produced(self) -> bool:
        """Whether SYNC was heard, or a node says that it produces it."""
        return self.heard > 0 or any(node.produces for node in self.nodes)

    def document(self) -> Document:
        """`dvtcli.sync-check/1`."""
        document: Document = {
            "schema": "dvtcli.sync-check/1",
            "produced": self.produced,
            "heard": self.heard,
            "listened_ms": self.listened_ms,
            "nodes": [{"node": node.node, "cob_id": node.cob_id, "period_us": node.period_us} for node in self.nodes],
        }
        if self.findings:
            document["findings"] = [finding_document(finding) for finding in self.findings]
        return document
