"""What commands answer: values that `view` turns into text, and that say their own JSON document.

Field names of documents are stable (README, "Machine output"). Knows no terminal and no session.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

from dvtcli.domain.datatypes import CanopenTime, Value
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Plan
from dvtcli.domain.ports import Frame
from dvtcli.domain.rules import Finding

Document = dict[str, Any]


class Result(Protocol):
    """What every command's answer can do."""

    @property
    def exit_code(self) -> int:
        """0, or 3 where differences exist."""
        ...

    def document(self) -> Document:
        """The answer as one JSON document."""
        ...


def hex_bytes(data: bytes | None) -> str | None:
    """Bytes as documents carry them: `01 02 00 00`, in the order of the wire."""
    return None if data is None else data.hex(" ").upper()


def json_value(value: Value) -> Any:
    """A value as JSON can carry it: bytes as hex, times as two numbers, `"nan"` and `"inf"` as text."""
    if isinstance(value, bytes):
        return hex_bytes(value)
    if isinstance(value, CanopenTime):
        return {"days": value.days, "milliseconds": value.milliseconds}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def finding_document(finding: Finding) -> Document:
    """A finding as JSON."""
    return {
        "rule": finding.rule,
        "severity": str(finding.severity),
        "place": finding.place,
        "text": finding.text,
        "abort": None if finding.abort is None else f"0x{finding.abort:08X}",
        "hint": finding.hint,
    }


@dataclass(frozen=True, slots=True)
class MappedName:
    """What a mapped object is called and which type it has; empty where no file says."""

    name: str = ""
    type_name: str = ""


@dataclass(frozen=True, slots=True)
class PdoRow:
    """One PDO with the names of what it maps."""

    pdo: Pdo
    config: PdoConfig
    names: tuple[MappedName, ...] = ()
    default_can_id: int | None = None
    unstored: bool = False

    def document(self) -> Document:
        """One element of `pdos` in `dvtcli.pdo/1`."""
        parameter = self.config.communication
        return {
            "pdo": str(self.pdo),
            "enabled": self.config.enabled,
            "cob_id": parameter.cob_id.can_id,
            "extended": parameter.cob_id.extended,
            "rtr_allowed": parameter.cob_id.rtr_allowed,
            "transmission_type": parameter.transmission_type,
            "inhibit_ms": None if parameter.inhibit_time is None else parameter.inhibit_time / 10,
            "event_timer_ms": parameter.event_timer,
            "sync_start": parameter.sync_start_value,
            "bits": self.config.bits,
            "mapping": self._mapping(),
        }

    def _mapping(self) -> list[Document]:
        rows, start = [], 0
        for number, entry in enumerate(self.config.mapping):
            name = self.names[number].name if number < len(self.names) else ""
            rows.append({"object": entry.object, "bits": entry.bits, "name": name, "start_bit": start})
            start += entry.bits
        return rows


@dataclass(frozen=True, slots=True)
class PdoListing:
    """A node's PDOs; *hidden* are left out of the text, *detail* asks for the frame picture of the one row."""

    node: int
    title: str
    rows: tuple[PdoRow, ...]
    show_all: bool = False
    detail: bool = False
    sync_period_us: int | None = None
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.pdo/1`."""
        return {"schema": "dvtcli.pdo/1", "node": self.node, "pdos": [row.document() for row in self.rows]}


@dataclass(frozen=True, slots=True)
class ValueRead:
    """One object's value, raw and decoded; *written* where a write set it."""

    node: int
    object: str
    name: str
    value: Value
    raw: bytes
    type_name: str
    unit: str = ""
    written: bool = False
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.value/1`."""
        return {
            "schema": "dvtcli.value/1",
            "node": self.node,
            "object": self.object,
            "value": json_value(self.value),
            "raw": hex_bytes(self.raw),
            "type": self.type_name,
            "name": self.name,
        }


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
    names: dict[str, str] = field(default_factory=dict)
    exit_code: int = 0

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
            "stored": False,
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


@dataclass(frozen=True, slots=True)
class ObjectRow:
    """One dictionary entry as `objects` shows it."""

    object: str
    name: str
    type_name: str
    access: str
    mappable: str
    default: str


@dataclass(frozen=True, slots=True)
class ObjectListing:
    """Entries of the object dictionary."""

    node: int | None
    source: str
    rows: tuple[ObjectRow, ...]
    total: int
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.objects/1`."""
        rows = [
            {
                "object": row.object,
                "name": row.name,
                "type": row.type_name,
                "access": row.access,
                "mappable": row.mappable.split(),
            }
            for row in self.rows
        ]
        return {"schema": "dvtcli.objects/1", "node": self.node, "source": self.source, "objects": rows}


@dataclass(frozen=True, slots=True)
class NodeRow:
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
            "note": self.note,
        }


@dataclass(frozen=True, slots=True)
class NodeListing:
    """Nodes that answered, or the one that was asked for (*detail*)."""

    bus: str
    rows: tuple[NodeRow, ...]
    seconds: float = 0.0
    detail: bool = False
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.nodes/1`."""
        return {"schema": "dvtcli.nodes/1", "bus": self.bus, "nodes": [row.document() for row in self.rows]}


@dataclass(frozen=True, slots=True)
class Commanded:
    """An NMT command that was sent, with the state it led to (None: not confirmed) and the changes that are *lost*."""

    node: int
    command: str
    state: str | None
    dry_run: bool
    lost: tuple[str, ...] = ()
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.nmt/1`."""
        return {
            "schema": "dvtcli.nmt/1",
            "node": self.node,
            "command": self.command,
            "state": self.state,
            "lost": list(self.lost),
            "dry_run": self.dry_run,
        }


@dataclass(frozen=True, slots=True)
class Synced:
    """SYNC messages that were sent and the frames that came in answer, by CAN-ID."""

    count: int
    period_ms: float
    frames: tuple[tuple[Frame, int, str], ...]
    dry_run: bool
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.sync/1`."""
        rows = [
            {"cob_id": frame.can_id, "pdo": label or None, "count": count, "data": hex_bytes(frame.data)}
            for frame, count, label in self.frames
        ]
        return {"schema": "dvtcli.sync/1", "syncs": self.count, "period_ms": self.period_ms, "frames": rows}


@dataclass(frozen=True, slots=True)
class FileFinding:
    """Something a file's reader noticed, with its line."""

    line: int
    severity: str
    text: str


@dataclass(frozen=True, slots=True)
class FileReport:
    """What `eds check` found: sections in the file, sections understood, and findings."""

    path: str
    sections: int
    understood: int
    objects: int
    findings: tuple[FileFinding, ...]
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.eds/1`."""
        return {
            "schema": "dvtcli.eds/1",
            "file": self.path,
            "sections": self.sections,
            "understood": self.understood,
            "objects": self.objects,
            "findings": [{"line": f.line, "severity": f.severity, "text": f.text} for f in self.findings],
        }


@dataclass(frozen=True, slots=True)
class Facts:
    """A few labelled lines: what was done or is so."""

    schema: str
    rows: tuple[tuple[str, Any], ...]
    text: tuple[str, ...]
    exit_code: int = 0
    #: warnings and notes that belong to them
    findings: tuple[Finding, ...] = ()

    def document(self) -> Document:
        """The rows under the result's own schema."""
        document: Document = {"schema": f"dvtcli.{self.schema}/1", **dict(self.rows)}
        if self.findings:
            document["findings"] = [finding_document(finding) for finding in self.findings]
        return document
