"""Nodes, NMT commands and SYNC as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.hint import Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules import Finding
from dvtcli.operations.results.documents import Answer, Document, Rows, Short, finding_document, hex_bytes

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError


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


@dataclass(frozen=True, slots=True)
class ProgramLoaded(Answer):
    """A program of *size* bytes from *file* that runs as program *number* of *node*; under *dry_run* nothing was sent.

    *before* and *after* are what 0x1F56 said of the old and of the new one, None where the device does not say;
    *expected* is what it was compared with, None for nothing, *expected_by* the profile that says so, empty where the
    user did. *restarted*: its boot-up message was heard.
    """

    renderer: ClassVar = "node_lines:program_lines"

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


@dataclass(frozen=True, slots=True)
class LoggedIn(Answer):
    """The access level that the node is at, and the one that was *wanted* (0: to be logged out)."""

    renderer: ClassVar = "node_lines:login_lines"

    node: int
    level: int
    wanted: int
    dry_run: bool
    #: what the level allows, in words
    allows: str = ""
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.login/1`."""
        return {
            "schema": "dvtcli.login/1",
            "node": self.node,
            "level": self.level,
            "wanted": self.wanted,
            "dry_run": self.dry_run,
        }


@dataclass(frozen=True, slots=True)
class NodeRow(Short):
    """What a node says of itself; None where it does not answer or has no such object."""

    node: int
    state: str
    device_type: int | None = None
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    name: str = ""
    profile: str = ""
    source: str = ""
    note: str = ""
    #: why the file *source* describes it, and what to know of that
    eds_why: str = ""
    eds_note: str = ""

    def document(self) -> Document:
        """One node of `dvtcli.nodes/1`."""
        return {
            "node": self.node,
            "state": self.state,
            "device_type": self.device_type,
            "vendor_id": self.vendor_id,
            "product_code": self.product_code,
            "revision": self.revision,
            "serial": self.serial,
            "name": self.name,
            "profile": self.profile,
            "eds": self.source,
            "eds_why": self.eds_why,
            "eds_note": self.eds_note,
            "note": self.note,
        }


@dataclass(frozen=True, slots=True)
class NodeListing(Answer, Rows[NodeRow]):
    """Nodes that answered, or the one that was asked for (*detail*)."""

    renderer: ClassVar = "node_lines:node_lines"
    at_leisure: ClassVar = True

    bus: str
    rows: tuple[NodeRow, ...]
    seconds: float = 0.0
    detail: bool = False
    exit_code: int = 0

    def __bool__(self) -> bool:
        return bool(self.rows)

    def document(self) -> Document:
        """`dvtcli.nodes/1`."""
        return {"schema": "dvtcli.nodes/1", "bus": self.bus, "nodes": [row.document() for row in self.rows]}


@dataclass(frozen=True, slots=True)
class Commanded(Answer):
    """An NMT command that was sent, to one node or all (0), with the state that each one is seen in.

    A state is None if it cannot be seen; *wanted* is the state that was asked for, None of a reset. *lost* are changes
    that the reset took; *notes* tell of nodes that answer without a boot-up message, or that an interrupted change left
    half configured.
    """

    renderer: ClassVar = "node_lines:commanded_lines"

    node: int
    command: str
    states: tuple[tuple[int, str | None], ...]
    dry_run: bool
    lost: tuple[str, ...] = ()
    wanted: str | None = None
    notes: tuple[Hint | str, ...] = ()

    def __bool__(self) -> bool:
        """Whether each node is seen in the state that was asked for: one that cannot be seen may be off."""
        return self.exit_code == 0 and (self.wanted is None or all(state is not None for _, state in self.states))

    @property
    def elsewhere(self) -> tuple[tuple[int, str], ...]:
        """The nodes that are seen in another state than the wanted one."""
        seen = ((node, state) for node, state in self.states if state is not None)
        return tuple((node, state) for node, state in seen if self.wanted not in (None, state))

    @property
    def exit_code(self) -> int:
        """1 where a node is seen in another state than the one that was asked for."""
        return 1 if self.elsewhere else 0

    @property
    def failure(self) -> DvtcliError | None:
        """What is to be said where the exit code is 1."""
        from dvtcli.operations.results.failures import not_obeyed

        return not_obeyed(self.node, self.wanted, self.elsewhere) if self.elsewhere else None

    def document(self) -> Document:
        """`dvtcli.nmt/1`."""
        return {
            "schema": "dvtcli.nmt/1",
            "node": self.node,
            "command": self.command,
            "state": next((state for _, state in self.states), None) if self.node else None,
            "wanted": self.wanted,
            "nodes": [{"node": node, "state": state} for node, state in self.states],
            "lost": list(self.lost),
            "notes": list(self.notes),
            "dry_run": self.dry_run,
        }


@dataclass(frozen=True, slots=True)
class Synced(Answer):
    """SYNC messages that were sent and the frames that came in answer, by CAN-ID."""

    renderer: ClassVar = "node_lines:synced_lines"

    count: int
    period_ms: float
    frames: tuple[tuple[Frame, int, str], ...]
    dry_run: bool
    can_id: int = 0x080
    exit_code: int = 0
    #: why no frame came, where that is known
    note: Hint | str = ""

    def document(self) -> Document:
        """`dvtcli.sync/1`."""
        rows = [
            {"cob_id": frame.can_id, "pdo": label or None, "count": count, "data": hex_bytes(frame.data)}
            for frame, count, label in self.frames
        ]
        return {
            "schema": "dvtcli.sync/1",
            "syncs": self.count,
            "period_ms": self.period_ms,
            "cob_id": self.can_id,
            "frames": rows,
        }
