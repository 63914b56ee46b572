"""The results of `plan`, `diff` and `apply`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

from dvtcli.domain.hint import Hint
from dvtcli.domain.network.network_plan import LeftOut, NetworkPlan, NodePlan
from dvtcli.domain.pdo import parameter_text
from dvtcli.domain.plan import PdoChange, ValueChange
from dvtcli.operations.results.documents import CASES, Answer, Document, finding_document, hex_bytes, lacking_documents

if TYPE_CHECKING:
    from dvtcli.domain.network.worst_case_load import WorstCaseLoad
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.rules import Finding
    from dvtcli.errors import DvtcliError, RuleError
    from dvtcli.operations.results.changes import Stored


@dataclass(frozen=True, slots=True)
class NetworkPlanned(Answer):
    """The writes that bring a network to its file's state; nothing was written.

    *tells*: a difference has its own exit code; *saved* is the file of the plan. *need* is the bus load afterwards,
    None if the bit rate is unknown; *interrupted* are nodes with a change to recover first.
    """

    renderer: ClassVar = "network_lines:planned_lines"
    formats: ClassVar = CASES
    show_findings: ClassVar = True

    plan: NetworkPlan
    tells: bool = False
    saved: str = ""
    need: WorstCaseLoad | None = None
    interrupted: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        """Tell whether nothing differs, neither to be written nor left unwritten."""
        return not self.plan.changed and not self.plan.remains and not self.plan.untold and not self.plan.lacking

    @property
    def exit_code(self) -> int:
        """1 if devices lack objects of the file; 3, if *tells*, for known differences or missing stores.

        Also 3 if a node's download by its manager is unknown.
        """
        if self.plan.lacking:
            return 1
        return 3 if self.tells and (self.plan.differs or self.plan.remains or self.plan.untold) else 0

    @property
    def failure(self) -> RuleError | None:
        """The error for exit code 1."""
        from dvtcli.operations.results.failures import missing_error

        return missing_error(self.plan.lacking) if self.plan.lacking else None

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """The error of a script line: the differing objects."""
        from dvtcli.operations.results.failures import not_as_wanted

        differing = _labels(self.plan) or ["what is stored"]
        return not_as_wanted(None, self.exit_code, differing, self.plan.file) if self.exit_code else None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings of the rules, of every node."""
        return network_findings(self.plan)

    def document(self) -> Document:
        """`dvtcli.plan/1`: saved by `plan -o`, read by `apply`."""
        from dvtcli.operations.results.loads import need_document

        plan = self.plan
        return {
            "schema": "dvtcli.plan/1",
            "file": plan.file,
            "changed": plan.changed,
            "writes": plan.writes,
            "remaining": plan.remains,
            "sync_master": plan.has_sync_master,
            "unknown_syncs": list(plan.unknown_syncs),
            "untold": list(plan.untold),
            "interrupted": list(self.interrupted),
            "load": None if self.need is None else need_document(self.need),
            "lacking": lacking_documents(plan.lacking),
            "nodes": [_node_document(node) for node in plan.nodes],
        }


def network_findings(plan: NetworkPlan) -> tuple[Finding, ...]:
    """Return the findings of all nodes of *plan*, with their nodes."""
    return tuple(_named(node.node_id, finding) for node in plan.nodes for finding in node.findings)


def _named(node_id: int, finding: Finding) -> Finding:
    """Add the node to *finding*; a finding of a link names its own."""
    is_of_node = not finding.place or finding.place.startswith("0x")
    return replace(finding, text=f"node {node_id}: {finding.text}") if is_of_node else finding


def _node_document(node: NodePlan) -> Document:
    from dvtcli.device.change.plan_document import change_document

    changes = node.plan.changes
    return {
        "node": node.node_id,
        "name": node.name,
        "identity": node.identity,
        "store": node.store or None,
        "read": node.is_read,
        "unstored": list(node.unstored),
        "left_out": [_left_out_document(left_out) for left_out in node.left_out],
        "power_off": node.needs_power_off,
        "doubt": node.doubt,
        "unchanged": node.unchanged,
        "also_equal": node.also_equal,
        "pdos": [_pdo_document(node, change) for change in changes if isinstance(change, PdoChange)],
        "objects": [_object_document(change) for change in changes if isinstance(change, ValueChange)],
        "findings": [finding_document(finding) for finding in node.findings],
        "changes": [change_document(change) for change in changes],
        "holds": [change_document(change) for change in node.holds],
        "also_holds": [change_document(change) for change in node.also_holds],
    }


def _left_out_document(one: LeftOut) -> Document:
    return {
        "object": one.object,
        "why": one.why,
        "remains": one.remains,
        "before": hex_bytes(one.held),
        "after": hex_bytes(one.said),
    }


def _pdo_document(node: NodePlan, change: PdoChange) -> Document:
    """The differences of a PDO: each parameter's actual and wanted value."""
    document: dict[str, Any] = {"pdo": str(change.pdo), "action": action(node, change)}
    document |= {key: [was, will] for key, was, will in differing(change)}
    return document


def action(node: NodePlan, change: PdoChange) -> str:
    """Return the action on a PDO: `prune`, `disable`, `enable` or `change`."""
    if change.pdo in node.pruned:
        return "prune"
    if change.before.enabled and not change.after.enabled:
        return "disable"
    return "enable" if change.after.enabled and not change.before.enabled else "change"


def _labels(plan: NetworkPlan, *, unwritten_only: bool = False) -> list[str]:
    """List differences with their nodes: those to write, unless *unwritten_only*, and those not written."""
    found: list[str] = []
    for node in plan.nodes:
        unreadable = node.plan.unreadable
        labels = [] if unwritten_only else [each.label for each in node.plan.changes if each not in unreadable]
        found += (
            f"{label} of node {node.node_id}" for label in [*labels, *(left_out.object for left_out in node.remaining)]
        )
    return list(dict.fromkeys(found))


def differing(change: PdoChange) -> Iterator[tuple[str, Any, Any]]:
    """Yield the network file's keys that differ in *change*, with both values."""
    rows = zip(_rows(change.before), _rows(change.after), strict=True)
    yield from ((key, was, will) for (key, was), (_, will) in rows if was != will)


def parameter_texts(change: PdoChange, key: str, was: Any, will: Any) -> tuple[str, str]:
    """Values of *key* before and after *change*, in the usual notation."""
    before, after = (config.communication.cob_id.extended for config in (change.before, change.after))
    return (
        parameter_text(key, was, change.pdo, extended=before),
        parameter_text(key, will, change.pdo, extended=after),
    )


def _rows(config: PdoConfig) -> Iterator[tuple[str, Any]]:
    parameter = config.communication
    cob_id = parameter.cob_id
    yield "enabled", cob_id.valid
    yield "cob_id", cob_id.can_id
    yield "extended", cob_id.extended
    yield "rtr_allowed", cob_id.rtr_allowed
    yield "type", parameter.transmission_type
    yield "inhibit_time", parameter.inhibit_time
    yield "event_timer", parameter.event_timer
    yield "sync_start", parameter.sync_start_value
    yield "map", [f"{entry.object}/{entry.bits}" for entry in config.mapping]


def _object_document(change: ValueChange) -> Document:
    step = change.step
    return {"object": step.object, "before": hex_bytes(step.before), "after": hex_bytes(step.after)}


@dataclass(frozen=True, slots=True)
class NetworkApplied(Answer):
    """A plan carried out and verified on every node; *stored* are the stores after it.

    *keep* says for each written node what makes its values permanent, empty if automatic; *kept_without* names values
    kept without a store beside those that need a store. Differing settings that the plan does not write remain:
    `plan.remains` counts them. For a clone (*is_clone*), meant to equal the other device, they are a difference.
    """

    renderer: ClassVar = "network_lines:applied_lines"

    plan: NetworkPlan
    dry_run: bool
    seconds: float
    stored: tuple[Stored, ...] = ()
    keep: Mapping[int, Hint | str] = field(default_factory=dict)
    kept_without: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    is_clone: bool = False
    #: nodes whose change a later `undo` does not know
    not_remembered: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        """Tell whether all is as wanted, and proved if requested."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """1 for a failed proof; 3 for an incomplete clone."""
        unlike = 3 if self.is_clone and self.plan.remains else 0
        return max((stored_node.exit_code for stored_node in self.stored), default=0) or unlike

    @property
    def failure(self) -> Any:
        """The error for exit code 1."""
        return next((stored_node.failure for stored_node in self.stored if stored_node.exit_code), None)

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """The error of a script line for an incomplete clone: the differing settings."""
        from dvtcli.operations.results.failures import not_as_wanted

        if not self.exit_code:
            return None
        failed = not_as_wanted(None, self.exit_code, _labels(self.plan, unwritten_only=True), self.plan.file)
        if self.plan.changed and not self.dry_run:
            failed.state, failed.state_text = "left_changed", "what may be written of the file was, and read back"
        return failed

    def document(self) -> Document:
        """`dvtcli.apply/1`."""
        return {
            "schema": "dvtcli.apply/1",
            "file": self.plan.file,
            "changed": self.plan.changed and not self.dry_run,
            "writes": self.plan.writes,
            "remaining": self.plan.remains,
            "unknown_syncs": list(self.plan.unknown_syncs),
            "untold": list(self.plan.untold),
            "verified": not (self.plan.unread or any(node.plan.unreadable for node in self.plan.nodes)),
            "dry_run": self.dry_run,
            "seconds": round(self.seconds, 3),
            "nodes": [_node_document(node) for node in self.plan.nodes],
            "stored": [_store_document(stored_node) for stored_node in self.stored],
        }


def _store_document(stored: Stored) -> Document:
    proof = stored.proof
    return {
        "node": stored.node,
        "object": stored.object,
        "seconds": round(stored.seconds, 3),
        "proved": None if proof is None else proof.holds,
    }
