"""Plan the writes for a network file: reads every node and reports all errors at once. Writes nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.other_producers import ReceivedIds, Senders, received_ids, seen_producer_findings
from dvtcli.device.proposal import proposal, readable_value, resolve, untyped_lengths
from dvtcli.device.read_pdos import read_optional, read_side_by_side
from dvtcli.device.store.unstored import held_unstored
from dvtcli.device.virtual_pdos import names_objects
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_config import NetworkConfig, NodeConfig
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
from dvtcli.domain.objects import CYCLE_PERIOD, SYNC_OVERFLOW
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, altering, plan_pdo
from dvtcli.domain.request import instead_findings
from dvtcli.domain.rules.finding import WARNING, Rule, warning
from dvtcli.errors import DvtcliError, InputFileError, NoAnswer, RuleError, SdoProtocolError
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.read_network import network_text
from dvtcli.operations.changes.change import mapped_names, scaled_changes
from dvtcli.operations.changes.possible_stores import refuse_stores_of
from dvtcli.operations.pdos.sync import short_frames, sync_note, unknown_syncs
from dvtcli.operations.plans.identify_nodes import IdentifiedNodes, identify_nodes
from dvtcli.operations.plans.judge_network import in_objects, judge_network, judge_plans, placed_in, refusals
from dvtcli.operations.plans.read_network_config import (
    named_nodes,
    nodes_by_stamp,
    of_nodes,
    read_network_config,
    skipped_rules,
    stamping,
    stamps_of,
    tell_unknown_bit_rate,
)
from dvtcli.operations.plans.resolve_names import (
    MissingObjects,
    ResolvedConfig,
    refuse_lacking,
    resolve_node_config,
    without_missing,
)
from dvtcli.operations.results.failures import missing_error, together

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_config import PartialPdoConfig
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.domain.rules import Finding
    from dvtcli.domain.store import Stamp
    from dvtcli.operations.pdos.sync import ShortFrames
    from dvtcli.operations.plans.judge_network import Placed
    from dvtcli.operations.session.session import Session, SessionNodes

RULES = (
    Rule("mapped-but-off", WARNING, "a network file gives a mapping or a timer to a PDO that is off and stays off",
         "ours; CiA 301, 7.5.2.35 and 7.5.2.37: bit 31 (valid)"),
    Rule("asked-nothing", WARNING, "a network file has a node without any settings", "ours"),
)  # fmt: skip
ASKS_NOTHING = "the file has no settings for it: nothing is written or compared"


def plan_network(session: Session, file: str, *, trust_stamp: bool = False, lists_missing: bool = False) -> NetworkPlan:
    """Plan the writes that bring the nodes of the network *file* to its values; reads them, writes nothing.

    *trust_stamp* skips nodes whose stamp (0x1020) matches, and reports them. With *lists_missing* the plan lists
    objects that devices lack as `lacking` and has the rest, if nothing else is wrong; without it they are a RuleError.
    Raises SafetyRefusal if a node is another device, InputFileError with all errors of the file, even those that only a
    node's dictionary shows, RuleError with all refusals of the rules, NoAnswer for silent nodes: the first of these
    that applies, with all other errors in its details.
    """
    config = read_network_config(file)
    for note in config.notes:
        session.reporter.note(f"{file}:{note.mark.line}:{note.mark.column}: {note.text}")
    config = of_nodes(session, file, config, named_nodes(session))
    tell_unknown_bit_rate(session, len(config.nodes))
    log = FileLog(file, network_text(file))
    network_plan = plan_network_config(
        session, config, log, trust_stamp=trust_stamp, lists_missing=lists_missing, of_network=True
    )
    undescribed = [
        node_plan.node_id for node_plan in network_plan.nodes if session.node(node_plan.node_id).dictionary is None
    ]
    if undescribed:
        session.reporter.note(f"{file}: {skipped_rules(undescribed)}")
    return network_plan


def plan_network_config(
    session: Session,
    config: NetworkConfig,
    log: FileLog,
    *,
    trust_stamp: bool = False,
    lists_missing: bool = False,
    of_network: bool = False,
    failures: list[DvtcliError] | None = None,
    by_rules: bool = True,
) -> NetworkPlan:
    """Plan the writes that bring the nodes of *config* to its values; *log* gets words without meaning.

    *of_network* adds the rules of networks for the state after the plan. *trust_stamp*, *lists_missing* and errors are
    as in `plan_network`; if *failures* is given, errors are appended to it, and the plan has the rest.
    Without *by_rules* the plan has no findings of the rules of single nodes.
    """
    with (
        short_frames(session.bus) as frames,
        received_ids(session.bus) as received,
        session.network.as_it_was_if_refused(),
    ):
        network_plan = _identify_and_plan(
            session,
            config,
            log,
            trust_stamp=trust_stamp,
            of_network=of_network,
            failures=failures,
            by_rules=by_rules,
            received=received,
        )
        if not lists_missing and failures is None:
            refuse_lacking(network_plan)
    return with_unknown_syncs(
        session, replace(network_plan, has_sync_master=_master_syncs(config), master=config.master), frames
    )


def _received_refusals(
    session: SessionNodes, network_plan: NetworkPlan, received: ReceivedIds, placed: Placed
) -> Iterator[RuleError]:
    """Yield an error for each node of *network_plan* whose TPDO would get a CAN-ID *received* from an unknown sender.

    *placed* gives a finding its place in the file.
    """
    for node_plan in network_plan.nodes if received.bus is not None else ():
        changes = [change for change in node_plan.plan.changes if isinstance(change, PdoChange)]
        held = {pdo: (want, want) for pdo, want in node_plan.wanted.items()}  # unless the plan changes it
        pdos = held | {change.pdo: (change.before, change.after) for change in changes}
        findings = seen_producer_findings(session.node(node_plan.node_id), pdos, received)
        if found := [placed(node_plan.node_id, finding) for finding in findings]:
            yield RuleError(f"node {node_plan.node_id}: {found[0].text}", found, node=node_plan.node_id)


def checked_network(
    session: Session, network_plan: NetworkPlan, received: ReceivedIds, *, of_device: bool
) -> NetworkPlan:
    """Judge *network_plan* of a file without a network, a saved plan or a plan *of_device*, by the rules of networks.

    Raises RuleError with their errors and with TPDOs that would get a CAN-ID *received* from an unknown sender, unless
    forced.
    """
    config = NetworkConfig(tuple(NodeConfig(node_plan.name, node_plan.node_id) for node_plan in network_plan.nodes))
    network_plan = judge_network(session, network_plan, config, FileLog(network_plan.file, ""), of_device=of_device)
    if not session.options.force:
        refused = [
            *refusals(network_plan.nodes),
            *_received_refusals(session, network_plan, received, in_objects(network_plan.nodes)),
        ]
        if refused:
            raise together(refused)
    return network_plan


def _master_syncs(config: NetworkConfig) -> bool:
    return config.master is not None and bool(config.master.sync_period_us)


def with_unknown_syncs(session: SessionNodes, network_plan: NetworkPlan, frames: ShortFrames) -> NetworkPlan:
    """Add to *network_plan* the SYNCs among *frames* from unknown producers; reports new ones."""
    if network_plan.has_sync_master:
        return network_plan
    found = unknown_syncs(frames, [session.network.nodes[node_id] for node_id in sorted(session.network.nodes)])
    for can_id in found:
        if can_id not in network_plan.unknown_syncs:
            session.reporter.note(sync_note(can_id))
    return replace(network_plan, unknown_syncs=tuple(sorted({*network_plan.unknown_syncs, *found})))


def _identify_and_plan(
    session: Session,
    config: NetworkConfig,
    log: FileLog,
    *,
    trust_stamp: bool,
    of_network: bool,
    failures: list[DvtcliError] | None,
    by_rules: bool,
    received: ReceivedIds,
) -> NetworkPlan:
    identified = identify_nodes(session, log.file, config)
    unread = nodes_by_stamp(identified.nodes, config) if trust_stamp else frozenset()
    node_plans: list[NodePlan] = []
    missing = MissingObjects(log)
    try:
        read, missing = without_missing(identified.nodes, config.of(identified.nodes.keys() - unread), log)
        node_plans = _judged(session, identified, read, log, by_rules=by_rules)
    except (InputFileError, RuleError, NoAnswer, SdoProtocolError) as failed:
        identified.failures.append(failed)
    node_plans += (_unread(identified.nodes[node.node_id], node) for node in config.nodes if node.node_id in unread)
    nodes = (
        _with_nothing_asked(
            replace(node_plan, lacks=missing.of(node_plan.node_id), boot_ups=identified.boot_ups[node_plan.node_id]),
            config,
            log,
        )
        for node_plan in sorted(node_plans, key=lambda planned_node: planned_node.node_id)
    )
    network_plan = NetworkPlan(log.file, tuple(nodes), lacking=tuple(missing.found), unlinked=missing.unlinked)
    if of_network and all(isinstance(failure, RuleError | InputFileError) for failure in identified.failures):
        network_plan = judge_network(session, network_plan, config, log)
    if not session.options.force:
        identified.failures += refusals(network_plan.nodes)
        identified.failures += _received_refusals(session, network_plan, received, placed_in(config, log))
    if (identified.failures or failures is not None) and missing.found:
        lacking = missing_error(missing.found)
        lacking.findings = tuple(
            replace(missing_object.finding, complaint=missing_object.complaint) for missing_object in missing.found
        )
        identified.failures.append(lacking)
    if failures is None:
        identified.end()
    else:
        failures += identified.failures
    return network_plan


def _with_nothing_asked(node_plan: NodePlan, config: NetworkConfig, log: FileLog) -> NodePlan:
    """Warn if the file of *config* names no value for the node."""
    if not node_plan.is_asked_nothing or node_plan.node_id not in config.asked_nothing:
        return node_plan
    found = warning("asked-nothing", "", ASKS_NOTHING)
    return replace(node_plan, findings=(*node_plan.findings, placed_in(config, log)(node_plan.node_id, found)))


def _unread(node: ReadableNode, config: NodeConfig) -> NodePlan:
    """Make the plan of *node* if it was not read: no changes."""
    plan = Plan(node.node_id, ())
    return NodePlan(config.name, plan, node.identity(), node.title, config.mark.line, is_read=False)


def _judged(
    session: SessionNodes, identified: IdentifiedNodes, config: NetworkConfig, log: FileLog, *, by_rules: bool
) -> list[NodePlan]:
    """Plan each identified node and judge it *by_rules*; errors are added to its failures.

    If names of a node are unknown, its other PDOs and all other nodes are judged all the same.
    """
    nodes = identified.nodes
    said: Mapping[int, tuple[Finding, ...]] = {}
    stamps, placed = stamps_of(nodes, config), placed_in(config, log)
    try:
        if config.links:
            from dvtcli.operations.plans.resolve_links import with_links

            found = with_links(nodes, _known(session, nodes), config)
            config, said = found.config, found.findings
    except RuleError as refused:
        refused.findings = tuple(placed(refused.node, finding) for finding in refused.findings)
        identified.failures.append(refused)
    resolved = {}
    for node in config.nodes:
        resolved[node.node_id] = resolve_node_config(nodes[node.node_id], node, log)
    node_plans, refusals = plans_of(nodes, config, resolved, stamps)
    for error in refusals:
        error.findings = tuple(placed(error.node, finding) for finding in error.findings)
        identified.failures.append(error)
    node_plans = [
        replace(node_plan, findings=(*said.get(node_plan.node_id, ()), *node_plan.findings)) for node_plan in node_plans
    ]
    if by_rules:
        node_plans = judge_plans(nodes, node_plans, force=session.options.force, placed=placed)
    try:
        refuse_stores_of(nodes, config, log)
    except RuleError as refused:
        identified.failures.append(refused)
    try:
        log.end(read=True)
    except InputFileError as wrong:
        identified.failures.append(wrong)
    return node_plans


def _known(session: SessionNodes, nodes: Mapping[int, NodeDescription]) -> Iterator[Node]:
    """List the session's other answering nodes: their CAN-IDs are not free."""
    for node_id in session.known_ids():
        with suppress(NoAnswer, SdoProtocolError):  # a node that is off hinders no change of another one
            if node_id not in nodes:
                session.network.node(node_id).known_cob_ids()
                yield session.network.node(node_id)


def plans_of(
    nodes: Mapping[int, Node],
    config: NetworkConfig,
    resolved: Mapping[int, ResolvedConfig],
    stamps: Mapping[int, Stamp],
) -> tuple[list[NodePlan], list[RuleError]]:
    """Plan, without judging, what brings each of *nodes* to its *resolved*; adds why PDOs are left out."""
    senders = Senders(
        nodes, {wanted_node.node_id: {pdo.pdo: _said(pdo) for pdo in wanted_node.pdos} for wanted_node in config.nodes}
    )
    refused: list[RuleError] = []
    read_side_by_side(
        nodes.values(), [partial(_look_ahead, nodes[node_id], want) for node_id, want in resolved.items()]
    )
    found = [_differences(nodes[node.node_id], resolved[node.node_id], senders, refused) for node in config.nodes]
    read_side_by_side(
        nodes.values(),
        [partial(_look_at_stamp, nodes[one.node_id], stamps.get(one.node_id), one.changes) for one in found],
    )
    node_plans = [
        _node_plan(nodes[node.node_id], node, resolved[node.node_id], differences, stamps.get(node.node_id))
        for node, differences in zip(config.nodes, found, strict=True)
    ]
    return node_plans, refused


def _look_ahead(node: ReadableNode, resolved: ResolvedConfig) -> None:
    """Read ahead for the plan of *node*; read errors are raised later, at their use."""
    with suppress(DvtcliError):
        node.observed(lambda: [node.known_pdo(pdo) for pdo in resolved.pdos])
        node.observed(lambda: [readable_value(node, *place) for place in resolved.values])


def _look_at_stamp(node: Node, stamp: Stamp | None, changes: Sequence[Change]) -> None:
    """Read ahead for the stamp of *node* after *changes*."""
    with suppress(DvtcliError):
        stamping(node, stamp, changes)


def _said(config: PartialPdoConfig) -> CobId | None:
    """Return the COB-ID in the file itself, before those of other PDOs are known."""
    if not isinstance(config.cob_id, int) or config.enabled is False:
        return None
    return CobId(config.cob_id, extended=config.extended)


class _Differences(NamedTuple):
    """The wanted PDOs of a node, the *changes* to reach them and its values, and the choices of `auto`."""

    node_id: int
    wanted: dict[Pdo, PdoConfig]
    changes: tuple[Change, ...]
    instead: tuple[Finding, ...]


def _differences(
    node: ReadableNode, resolved: ResolvedConfig, senders: Senders, refused: list[RuleError]
) -> _Differences:
    """Compare *node* with *resolved*; *refused* gets the reasons for PDOs that cannot be made."""
    elsewhere = cache(partial(senders.besides, node.node_id))
    lengths = untyped_lengths(node, resolved.pdos.values())
    now = node.observed(lambda: {pdo: node.known_pdo(pdo) for pdo in resolved.pdos})
    wanted: dict[Pdo, PdoConfig] = {}
    for pdo, want in resolved.pdos.items():
        try:
            wanted[pdo] = resolve(node, pdo, now[pdo], want, lengths, elsewhere)
        except RuleError as error:
            refused.append(error)
    senders.after[node.node_id] = {pdo: config.communication.cob_id for pdo, config in wanted.items()}
    held = node.observed(lambda: {place: readable_value(node, *place) for place in resolved.values})
    values = _values(node, resolved, held)
    pdos = [plan_pdo(pdo, now[pdo], want) for pdo, want in wanted.items()]
    proposed = (
        (resolved.pdos[pdo], proposal(node, pdo, now[pdo], want, wanted, elsewhere, senders.channels))
        for pdo, want in wanted.items()
    )
    instead = (finding for want, pdo_proposal in proposed for finding in instead_findings(want, pdo_proposal))
    changes: tuple[Change, ...] = (*values, *(change for change in pdos if change.steps))
    return _Differences(node.node_id, wanted, changes, tuple(instead))


def _node_plan(
    node: Node, config: NodeConfig, resolved: ResolvedConfig, differences: _Differences, stamp: Stamp | None
) -> NodePlan:
    """Make the plan of *node*, which ends its stamp or writes *stamp*."""
    wanted, changes = differences.wanted, differences.changes
    stamped = stamping(node, stamp, changes)
    plan = Plan(node.node_id, (*stamped.changes, *changes))
    return NodePlan(
        config.name, plan, node.identity(), node.title, config.mark.line, str(config.store or ""), wanted,
        {**resolved.values, **stamped.values}, resolved.pruned,
        lines={pdo.pdo: pdo.mark.line for pdo in config.pdos}, object_lines=dict(resolved.lines),
        names=mapped_names(node, plan.changes), understood=scaled_changes(node, plan.changes),
        unstored=_unstored(node, plan) if config.store else (),
        findings=(*stamped.findings, *differences.instead, *_left_off(config, wanted)),
    )  # fmt: skip


def _left_off(config: NodeConfig, wanted: Mapping[Pdo, PdoConfig]) -> Iterator[Finding]:
    """Warn about each PDO that gets a mapping or a timer but stays disabled, unless the file disables it."""
    for pdo in config.pdos:
        sets = [name for name, value in (("a mapping", pdo.mapping), ("an event timer", pdo.event_timer)) if value]
        if sets and pdo.enabled is None and pdo.pdo in wanted and not wanted[pdo.pdo].enabled:
            given = " and ".join(sets)
            text = f"{pdo.pdo.label} is off and stays off: the file gives it {given}"
            hint = "enabled: true in the file switches it on; enabled: false ends this warning"
            yield warning("mapped-but-off", f"0x{pdo.pdo.communication_index:04X}:01", text, hint)


def _values(
    node: ReadableNode, resolved: ResolvedConfig, held: Mapping[ObjectAddress, bytes | None]
) -> list[ValueChange]:
    """List differing values, and a SYNC period that must be 0 while the counter overflow (0x1019) changes."""
    wanted = {**_period_kept(node, resolved, held), **resolved.values}
    changes = {
        place: value_change(node, place, held.get(place, data), data, resolved.reasons.get(place, "write"))
        for place, data in wanted.items()
    }
    return [changes[step.index, step.sub_index] for step in altering(change.step for change in changes.values())]


def _period_kept(
    node: ReadableNode, resolved: ResolvedConfig, held: Mapping[ObjectAddress, bytes | None]
) -> Mapping[ObjectAddress, bytes]:
    """Return the SYNC period to keep, if it blocks a wanted change and no other period is wanted."""
    overflow, period = (SYNC_OVERFLOW, 0), (CYCLE_PERIOD, 0)
    if period in resolved.values or held.get(overflow) == resolved.values.get(overflow):
        return {}
    number = node.observed(lambda: read_optional(node.read_cache, *period, 4))
    return {period: number.to_bytes(4, "little")} if number else {}


def _unstored(node: Node, plan: Plan) -> tuple[str, ...]:
    """List labels of changes that *node* holds and that are not known to be stored.

    Leaves out what *plan* changes: the old value need not be stored, and the new value may equal the stored value.
    """
    remembered = {} if node.guard is None else held_unstored(node, node.guard.history, node.identity())
    changed = {change.label for change in plan.changes}
    return tuple(label for label in {**remembered, **node.unstored} if label not in changed)


def value_change(
    node: NodeDescription, place: tuple[int, int], held: bytes | None, data: bytes, reason: str
) -> ValueChange:
    """Make the change of the object at *place* of *node* from *held* to *data*."""
    return ValueChange(Step(*place, held, data, reason, names_object=names_objects(node, *place)))
