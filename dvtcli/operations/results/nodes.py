"""Nodes, NMT commands and SYNC as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.can_ids import SYNC_ID
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.emergency_codes import register_words
from dvtcli.domain.hint import Hint
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules.finding import Finding
from dvtcli.domain.times import utc
from dvtcli.operations.results.documents import Answer, Document, Rows, Short, finding_document, hex_bytes

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError

#: Bit 30 of 0x1005: SYNC producer.
_PRODUCES = 1 << 30


@dataclass(frozen=True, slots=True)
class SyncSource(Short):
    """A node's SYNC: *cob_id* is 0x1005, *period_us* 0x1006; None if absent."""

    node: int
    cob_id: int | None
    period_us: int | None

    @property
    def produces(self) -> bool:
        """Tell whether it is a SYNC producer."""
        return bool(self.cob_id is not None and self.cob_id & _PRODUCES and self.period_us)

    @property
    def can_id(self) -> int:
        """Its CAN-ID of SYNC."""
        return SYNC_ID if self.cob_id is None else self.cob_id & 0x1FFF_FFFF

    @property
    def extended(self) -> bool:
        """Tell whether that CAN-ID has 29 bits (bit 29 of 0x1005)."""
        return self.cob_id is not None and CobId.from_raw(self.cob_id).extended


@dataclass(frozen=True, slots=True)
class SyncCheck(Answer):
    """The SYNC producers by nodes, and SYNCs *heard* within *listened_ms*; true if there are any."""

    renderer: ClassVar = "node_lines:sync_check_lines"
    use_pager: ClassVar = True
    show_findings: ClassVar = True

    nodes: tuple[SyncSource, ...]
    heard: int
    listened_ms: int
    findings: tuple[Finding, ...] = ()
    exit_code: int = 0

    def __bool__(self) -> bool:
        return self.produced

    @property
    def produced(self) -> bool:
        """Tell whether SYNC was received, or a node is a producer."""
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
    """A program of *size* bytes from *file*, running as program *number* of *node*; *dry_run*: nothing was sent.

    *before* and *after* are 0x1F56 of the old and the new program, None if absent; *expected* is its required value,
    None for any, *expected_by* the profile that requires it, empty for the user. *restarted*: its boot-up message was
    received.
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
    """The node's access level, and the *wanted* level (0: logged out)."""

    renderer: ClassVar = "node_lines:login_lines"

    node: int
    level: int
    wanted: int
    dry_run: bool
    #: the level's rights, in words
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
    """A node's identification; None if unanswered or absent."""

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
    #: why the file *source* describes it, and its remark
    eds_why: str = ""
    eds_note: str = ""

    def document(self) -> Document:
        """A node in `dvtcli.nodes/1`."""
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
    """The answering nodes, or the requested node (*detail*)."""

    renderer: ClassVar = "node_lines:node_lines"
    use_pager: ClassVar = True

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
    """An NMT command sent to a node or all (0), with the resulting states.

    A state is None if unknown; *wanted* is the commanded state, None for a reset. *lost* are changes lost by the reset;
    *notes* name nodes that answer without a boot-up message, or are half configured by an interrupted change.
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
        """Tell whether each node is in the commanded state: an unknown state may mean off."""
        return self.exit_code == 0 and (self.wanted is None or all(state is not None for _, state in self.states))

    @property
    def elsewhere(self) -> tuple[tuple[int, str], ...]:
        """The nodes in another state than the commanded state."""
        seen = ((node, state) for node, state in self.states if state is not None)
        return tuple((node, state) for node, state in seen if self.wanted not in (None, state))

    @property
    def exit_code(self) -> int:
        """1 if a node is in another state than the commanded state."""
        return 1 if self.elsewhere else 0

    @property
    def failure(self) -> DvtcliError | None:
        """The error for exit code 1."""
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
    """The SYNC messages sent, and the frames received after them, by CAN-ID."""

    renderer: ClassVar = "node_lines:synced_lines"

    count: int
    period_ms: float
    frames: tuple[tuple[Frame, int, str], ...]
    dry_run: bool
    can_id: int = SYNC_ID
    exit_code: int = 0
    #: whether that CAN-ID has 29 bits
    extended: bool = False
    #: why no frame was received, if known
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


@dataclass(frozen=True, slots=True)
class FaultRow(Short):
    """An error by *code*, with meaning and remedy (empty if unknown).

    *source* is `active` for the family's own list, `history` for 0x1003, `heard` for EMCY messages. *information* is
    the manufacturer's field in the history; *count*, *first_s*, *last_s* (s since 1970), *register* and *manufacturer*
    are of messages.
    """

    source: str
    code: int
    text: str
    remedy: Hint | str = ""
    information: int | None = None
    count: int | None = None
    first_s: float | None = None
    last_s: float | None = None
    register: int | None = None
    manufacturer: bytes | None = None

    def document(self) -> Document:
        """The row as JSON."""
        return {
            "source": self.source,
            "code": self.code,
            "text": self.text,
            "remedy": self.remedy or None,
            "information": self.information,
            "count": self.count,
            "first": None if self.first_s is None else utc(self.first_s),
            "last": None if self.last_s is None else utc(self.last_s),
            "register": self.register,
            "manufacturer": hex_bytes(self.manufacturer),
        }


@dataclass(frozen=True, slots=True)
class Faults(Answer, Rows[FaultRow]):
    """The errors of a node, a list of rows: its own list, its history (newest first), received messages.

    *register* is 0x1001, None if absent; *has_history*: 0x1003 exists. After *cleared* the rows are the old history.
    """

    renderer: ClassVar = "node_lines:fault_lines"
    use_pager: ClassVar = True

    node: int
    name: str
    register: int | None
    has_history: bool
    rows: tuple[FaultRow, ...]
    cleared: bool = False
    dry_run: bool = False
    exit_code: int = 0

    @property
    def register_words(self) -> tuple[str, ...]:
        """The errors in the register."""
        return register_words(self.register or 0)

    def document(self) -> Document:
        """`dvtcli.faults/1`."""
        return {
            "schema": "dvtcli.faults/1",
            "node": self.node,
            "register": self.register,
            "register_bits": list(self.register_words),
            "has_history": self.has_history,
            "cleared": self.cleared,
            "dry_run": self.dry_run,
            "faults": [row.document() for row in self.rows],
        }


@dataclass(frozen=True, slots=True)
class FaultSeen(Answer):
    """An EMCY message received from *node*; *fault* has its meaning and count."""

    renderer: ClassVar = "node_lines:fault_seen_lines"

    node: int
    fault: FaultRow
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.emergency/1`."""
        fault = self.fault
        return {
            "schema": "dvtcli.emergency/1",
            "time": utc(fault.last_s or 0.0),
            "node": self.node,
            "code": fault.code,
            "text": fault.text,
            "remedy": fault.remedy or None,
            "count": fault.count,
            "register": fault.register,
            "register_bits": list(register_words(fault.register or 0)),
            "manufacturer": hex_bytes(fault.manufacturer),
        }
