"""The results of `plan`, `diff` and `apply`, and of `load`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

from dvtcli.domain.hint import Hint
from dvtcli.domain.network.network_plan import LeftOut, NetworkPlan, NodePlan
from dvtcli.domain.network.worst_case_load import most_frames
from dvtcli.domain.pdo import parameter_text
from dvtcli.domain.plan import PdoChange, ValueChange
from dvtcli.operations.results.documents import (
    CASES,
    Answer,
    Document,
    Short,
    finding_document,
    hex_bytes,
    lacking_documents,
)
from dvtcli.watch.service import service_of

if TYPE_CHECKING:
    from dvtcli.domain.network.network_state import Identifier
    from dvtcli.domain.network.worst_case_load import StreamLoad, WorstCaseLoad
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.errors import DvtcliError, RuleError
    from dvtcli.operations.results.changes import Stored
    from dvtcli.watch.statistics import Counted, FrameCount


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


def _node_document(node_plan: NodePlan) -> Document:
    from dvtcli.device.change.plan_document import change_document

    changes = node_plan.plan.changes
    return {
        "node": node_plan.node_id,
        "name": node_plan.name,
        "identity": node_plan.identity,
        "store": node_plan.store or None,
        "read": node_plan.is_read,
        "unstored": list(node_plan.unstored),
        "left_out": [_left_out_document(left_out) for left_out in node_plan.left_out],
        "power_off": node_plan.needs_power_off,
        "doubt": node_plan.doubt,
        "unchanged": node_plan.unchanged,
        "also_equal": node_plan.also_equal,
        "pdos": [_pdo_document(node_plan, change) for change in changes if isinstance(change, PdoChange)],
        "objects": [_object_document(change) for change in changes if isinstance(change, ValueChange)],
        "findings": [finding_document(finding) for finding in node_plan.findings],
        "changes": [change_document(change) for change in changes],
        "holds": [change_document(change) for change in node_plan.holds],
        "also_holds": [change_document(change) for change in node_plan.compared_claims],
    }


def _left_out_document(one: LeftOut) -> Document:
    return {
        "object": one.object,
        "why": one.why,
        "remains": one.remains,
        "before": hex_bytes(one.held),
        "after": hex_bytes(one.said),
    }


def _pdo_document(node_plan: NodePlan, change: PdoChange) -> Document:
    """The differences of a PDO: each parameter's actual and wanted value."""
    document: dict[str, Any] = {"pdo": str(change.pdo), "action": action(node_plan, change)}
    document |= {key: [was, will] for key, was, will in differing(change)}
    return document


def action(node_plan: NodePlan, change: PdoChange) -> str:
    """Return the action on a PDO: `prune`, `disable`, `enable` or `change`."""
    if change.pdo in node_plan.pruned:
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


@dataclass(frozen=True, slots=True)
class Measured(Short):
    """Measured traffic: frames counted in *seconds*, and damaged or lost frames."""

    count: FrameCount
    seconds: float
    error_frames: int = 0
    lost_frames: int = 0

    def load(self, bit_rate: int) -> float:
        """The share of a bus at *bit_rate* bit/s taken by the frames, with actual stuff bits."""
        return self.count.bits / (self.seconds * bit_rate) if self.seconds else 0.0

    def share(self, identifier: Identifier, bit_rate: int) -> float:
        """The share of the frames of a CAN-ID."""
        counted = self.count.by_id.get(identifier)
        return 0.0 if counted is None or not self.seconds else counted.bits / (self.seconds * bit_rate)

    def rate_hz(self, identifier: Identifier) -> float:
        """The frames per second of a CAN-ID."""
        counted = self.count.by_id.get(identifier)
        return 0.0 if counted is None or not self.seconds else counted.frames / self.seconds


@dataclass(frozen=True, slots=True)
class FrameLoad(Short):
    """A CAN-ID: *needs* are computed, empty if only received; *heard* is measured."""

    identifier: Identifier
    needs: tuple[StreamLoad, ...] = ()
    heard: Counted | None = None

    @property
    def label(self) -> str:
        """Name it: by the pre-defined connection set if only received."""
        if self.needs:
            return self.needs[0].stream.label
        can_id, extended = self.identifier
        return service_of(can_id, extended=extended).label

    @property
    def node(self) -> int | None:
        """Its node."""
        if self.needs:
            return self.needs[0].stream.node
        can_id, extended = self.identifier
        return service_of(can_id, extended=extended).node


@dataclass(frozen=True, slots=True)
class NetworkLoad(Answer):
    """The worst-case load of a network (*need*), fitting bit rates, and the *measured* load.

    *file* and *bus* name their sources; *is_assumed*: the bit rate is assumed.
    """

    renderer: ClassVar = "load_lines:load_lines"
    use_pager: ClassVar = True

    need: WorstCaseLoad
    fitting: tuple[int, ...]
    file: str = ""
    bus: str = ""
    is_assumed: bool = False
    measured: Measured | None = None
    exit_code: int = field(default=0, init=False)

    def __bool__(self) -> bool:
        """Tell whether every frame is in time in the worst case."""
        return self.need.fits

    @property
    def expected(self) -> float | None:
        """The load by computed rates with the bits of received frames.

        Only of frames computed and received, without EMCY; None without a measurement.
        """
        measured = self.measured
        if measured is None or not measured.seconds:
            return None
        bits = Fraction(0)
        for frame in self.frames:
            if frame.heard is not None and frame.needs and frame.needs[0].stream.kind != "emcy":
                rates = [
                    Fraction(1_000_000) / n.stream.frame.period_us for n in frame.needs if n.stream.frame.period_us
                ]
                bits += sum(rates, Fraction(0)) * frame.heard.bits / frame.heard.frames
        return float(bits / self.need.bit_rate)

    @property
    def too_often(self) -> tuple[FrameLoad, ...]:
        """Frames received more often than in the worst case: the node differs, or two nodes transmit them."""
        return tuple(frame for frame in self.frames if self._is_too_often(frame))

    def _is_too_often(self, one: FrameLoad) -> bool:
        if one.heard is None or not one.needs or self.measured is None:
            return False
        most = most_frames((need.stream for need in one.needs), self.measured.seconds)
        return most is not None and one.heard.frames > most

    @property
    def frames(self) -> tuple[FrameLoad, ...]:
        """Every CAN-ID computed or received, in order of priority."""
        needs: dict[Identifier, list[StreamLoad]] = {}
        for need in self.need.needs:
            needs.setdefault((need.stream.frame.can_id, need.stream.frame.extended), []).append(need)
        heard = self.measured.count.by_id if self.measured is not None else {}
        only_received = [identifier for identifier in heard if identifier not in needs]
        order = sorted(
            [*needs, *only_received],
            key=lambda frame_address: (
                frame_address[0] >> 18 if frame_address[1] else frame_address[0],
                frame_address[1],
                frame_address[0],
            ),
        )
        return tuple(
            FrameLoad(frame_address, tuple(needs.get(frame_address, ())), heard.get(frame_address))
            for frame_address in order
        )

    def document(self) -> Document:
        """`dvtcli.load/1`."""
        return {
            "schema": "dvtcli.load/1",
            "file": self.file or None,
            "bus": self.bus or None,
            "bit_rate_assumed": self.is_assumed,
            **need_document(self.need),
            "fitting_bit_rates": list(self.fitting),
            "assumed": list(self.need.assumed),
            "measured": self._measured(),
            "frames": [self._frame(frame) for frame in self.frames],
        }

    def _measured(self) -> Document | None:
        measured = self.measured
        if measured is None or not measured.seconds:
            return None
        return {
            "seconds": round(measured.seconds, 3),
            "frames": measured.count.frames,
            "error_frames": measured.error_frames,
            "lost_frames": measured.lost_frames,
            "load": round(measured.load(self.need.bit_rate), 6),
            "expected_load": None if self.expected is None else round(self.expected, 6),
        }

    def _frame(self, one: FrameLoad) -> Document:
        can_id, extended = one.identifier
        heard = one.heard
        return {
            "cob_id": can_id,
            "extended": extended,
            "what": one.label,
            "node": one.node,
            "worst": [_need(need) for need in one.needs],
            "measured": None
            if heard is None or self.measured is None
            else {
                "frames": heard.frames,
                "rate_hz": round(self.measured.rate_hz(one.identifier), 3),
                "load": round(self.measured.share(one.identifier, self.need.bit_rate), 6),
                "too_often": self._is_too_often(one),
                "shortest_ms": None if heard.shortest_s is None else round(1000 * heard.shortest_s, 3),
                "longest_ms": None if heard.longest_s is None else round(1000 * heard.longest_s, 3),
            },
        }


def need_document(need: WorstCaseLoad) -> Document:
    """The load of a network in all."""
    return {
        "bit_rate": need.bit_rate,
        "load": None if need.total is None else round(float(need.total), 6),
        "limited_load": round(float(need.limited), 6),
        "unlimited": [_who(stream.node, stream.label) for stream in need.unlimited],
        "late": [_who(stream_need.stream.node, stream_need.stream.label) for stream_need in need.late],
        "fits": need.fits,
    }


def _need(need: StreamLoad) -> Document:
    stream = need.stream
    return {
        "kind": stream.kind,
        "label": stream.label,
        "remote": stream.frame.remote,
        "length": stream.frame.data_bytes,
        "bits": stream.frame.bits,
        "period_us": _number(stream.frame.period_us),
        "why": stream.why,
        "assumed": stream.assumed,
        "jitter_us": _number(stream.frame.jitter_us),
        "load": None if need.share is None else round(float(need.share), 6),
        "response_us": _number(need.response_us),
        "deadline_us": _number(stream.deadline_us),
        "late": need.is_late,
    }


def _number(time_us: Fraction | int | None) -> float | None:
    return None if time_us is None else round(float(time_us), 3)


def _who(node: int | None, label: str) -> str:
    return label if node is None else f"{node}:{label.lower()}"
