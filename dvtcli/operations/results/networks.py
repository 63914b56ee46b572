"""What `plan`, `diff` and `apply` answer. Knows no terminal and no session."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

from dvtcli.domain.hint import Hint
from dvtcli.domain.network.network_plan import LeftOut, NetworkPlan, NodePlan
from dvtcli.domain.plan import PdoChange, ValueChange
from dvtcli.operations.results.documents import CASES, Answer, Document, finding_document, hex_bytes, lacking_documents
from dvtcli.operations.results.loads import need_document

if TYPE_CHECKING:
    from dvtcli.domain.network.bus_need import BusNeed
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.rules import Finding
    from dvtcli.errors import DvtcliError, RuleError
    from dvtcli.operations.results.stores import Stored


@dataclass(frozen=True, slots=True)
class NetworkPlanned(Answer):
    """What has to be written for a network to be as its file says; nothing was.

    *tells* says whether a difference is an exit code of its own; *saved* is the file that the plan was written to.
    *need* is what all frames need of the bus afterwards, None where its bit rate is not known; *interrupted* are nodes
    of which a change waits to be recovered first.
    """

    renderer: ClassVar = "network_lines:planned_lines"
    formats: ClassVar = CASES
    remarked: ClassVar = True

    plan: NetworkPlan
    tells: bool = False
    saved: str = ""
    need: BusNeed | None = None
    interrupted: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        """Whether nothing differs: nothing has to be written, and nothing is otherwise that is not written."""
        return not self.plan.changed and not self.plan.remains and not self.plan.untold and not self.plan.lacking

    @property
    def exit_code(self) -> int:
        """1 where devices lack what the file sets; 3 where that is told, and something differs or is to be stored.

        Also where of a node nobody knows what its manager should have of it.
        """
        if self.plan.lacking:
            return 1
        return 3 if self.tells and (self.plan.to_do or self.plan.remains or self.plan.untold) else 0

    @property
    def failure(self) -> RuleError | None:
        """What is to be said where the exit code is 1."""
        from dvtcli.operations.results.failures import lacking_error

        return lacking_error(self.plan.lacking) if self.plan.lacking else None

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """What a script says where it ends with this line: which objects differ."""
        from dvtcli.operations.results.failures import not_as_wanted

        differing = _labels(self.plan) or ["what is stored"]
        return not_as_wanted(None, self.exit_code, differing, self.plan.file) if self.exit_code else None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the rules said, of every node."""
        return network_findings(self.plan)

    def document(self) -> Document:
        """`dvtcli.plan/1`: what `plan -o` saves, and `apply` takes."""
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
    """What the rules said of every node of *plan*, each with its node."""
    return tuple(_named(node.node_id, finding) for node in plan.nodes for finding in node.findings)


def _named(node_id: int, finding: Finding) -> Finding:
    """*finding* with its node, which that of a link names itself."""
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
    """What differs of one PDO: each parameter as it is and as it is wanted."""
    document: dict[str, Any] = {"pdo": str(change.pdo), "action": action(node, change)}
    document |= {key: [was, will] for key, was, will in differing(change)}
    return document


def action(node: NodePlan, change: PdoChange) -> str:
    """What happens to a PDO: `prune`, `disable`, `enable` or `change`."""
    if change.pdo in node.pruned:
        return "prune"
    if change.before.enabled and not change.after.enabled:
        return "disable"
    return "enable" if change.after.enabled and not change.before.enabled else "change"


def _labels(plan: NetworkPlan, *, unwritten_only: bool = False) -> list[str]:
    """What differs, of which node: what is to be written, unless *unwritten_only*, and what is not."""
    found: list[str] = []
    for node in plan.nodes:
        labels = [] if unwritten_only else [change.label for change in node.plan.changes]
        found += (
            f"{label} of node {node.node_id}" for label in [*labels, *(left_out.object for left_out in node.remaining)]
        )
    return list(dict.fromkeys(found))


def differing(change: PdoChange) -> Iterator[tuple[str, Any, Any]]:
    """The keys of a network file in which the two sides of *change* differ, with both values."""
    rows = zip(_rows(change.before), _rows(change.after), strict=True)
    yield from ((key, was, will) for (key, was), (_, will) in rows if was != will)


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
    """A plan that every node took and read back equal; *stored* are those that stored it then.

    *keep* says of each node that was written what keeps it there, empty where it does so by itself; *kept_without*
    names what a node keeps without a store beside what it does not.
    A setting that differs and that the plan does not write is so still: `plan.remains` counts them. Of a clone
    (*is_clone*), which is to be the other device's equal, that is a difference of its own.
    """

    renderer: ClassVar = "network_lines:applied_lines"

    plan: NetworkPlan
    dry_run: bool
    seconds: float
    stored: tuple[Stored, ...] = ()
    keep: Mapping[int, Hint | str] = field(default_factory=dict)
    kept_without: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    is_clone: bool = False
    #: nodes of whose change a later `undo` does not know
    not_remembered: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        """Whether it is as it should be, and proved if that was asked for."""
        return self.exit_code == 0

    @property
    def exit_code(self) -> int:
        """1 where a proof that was asked for failed, or what it should have shown is not so; 3 of an unlike clone."""
        unlike = 3 if self.is_clone and self.plan.remains else 0
        return max((stored_node.exit_code for stored_node in self.stored), default=0) or unlike

    @property
    def failure(self) -> Any:
        """What is to be said where the exit code is 1."""
        return next((stored_node.failure for stored_node in self.stored if stored_node.exit_code), None)

    @property
    def failure_of_line(self) -> DvtcliError | None:
        """What a script says where it ends with a clone that is none: which settings differ still."""
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
