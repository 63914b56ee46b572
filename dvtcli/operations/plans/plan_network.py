"""From a network file to what is to be written: every node is read, everything wrong is said at once, nothing is sent.

Writes nothing. Does not know how a plan is carried out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.heard_producers import HeardIds, heard_ids, heard_producer_findings
from dvtcli.device.proposal import proposal
from dvtcli.device.read_cache import read_side_by_side
from dvtcli.device.read_pdos import read_optional
from dvtcli.device.resolve import resolve, untyped_lengths
from dvtcli.device.senders import Senders
from dvtcli.device.unstored import held_unstored
from dvtcli.device.virtual_pdos import names_objects
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
from dvtcli.domain.network.wanted_state import NetworkWish, NodeWish
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.domain.request import instead_findings
from dvtcli.domain.rules.finding import WARNING, Rule, warning
from dvtcli.domain.value_order import SYNC_OVERFLOW, SYNC_PERIOD, altering
from dvtcli.errors import DvtcliError, InputFileError, NoAnswer, RuleError, SdoProtocolError
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.read_network import network_text
from dvtcli.operations.changes.change import names, understood
from dvtcli.operations.plans.judge_network import in_objects, judged, judged_network, placed_in, refusals
from dvtcli.operations.results.failures import lacking_error, together
from dvtcli.operations.stores.possible_stores import refuse_stores_of
from dvtcli.operations.sync.unknown_sync import short_frames, sync_note, unknown_syncs
from dvtcli.operations.wanted.chosen_nodes import named_nodes, of_nodes
from dvtcli.operations.wanted.identify_nodes import IdentifiedNodes, meet
from dvtcli.operations.wanted.linked_wishes import with_links
from dvtcli.operations.wanted.missing_objects import LackedOfWish, refuse_lacking, without_lacked
from dvtcli.operations.wanted.network_wish import read_wish, skipped_rules
from dvtcli.operations.wanted.resolve_names import NodeWants, node_wants
from dvtcli.operations.wanted.stamping import stamping, stamps_of, trusted
from dvtcli.operations.wanted.unknown_bit_rate import tell_unknown_bit_rate

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.network.wanted_state import PdoWish
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.domain.rules import Finding
    from dvtcli.domain.stamp import Stamp
    from dvtcli.operations.plans.judge_network import Placed
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.sync.unknown_sync import ShortFrames

RULES = (
    Rule("mapped-but-off", WARNING, "a network file gives a PDO a mapping or a timer, and it is off and stays off",
         "ours; CiA 301, 7.5.2.35 and 7.5.2.37: bit 31 (valid)"),
    Rule("asked-nothing", WARNING, "a network file names a node and says nothing that it should hold", "ours"),
)  # fmt: skip
ASKS_NOTHING = "the file asks for nothing of it: nothing is set, and nothing is compared"


def plan_network(session: Session, file: str, *, trust_stamp: bool = False, as_far: bool = False) -> NetworkPlan:
    """What has to be written for the nodes of the network *file* to hold what it says; reads them, writes nothing.

    With *trust_stamp* not those whose 0x1020 says that they do, which the answer says. With *as_far* what devices lack
    is `lacking` in the answer, which has all the rest, where nothing else is wrong; without it that is a RuleError.
    SafetyRefusal where a node is another device, InputFileError with everything that is wrong in the file, also what
    only a node's dictionary knows, RuleError with all that the rules refuse, NoAnswer where nodes are silent: the first
    of these that there is, with all else that is wrong among its details.
    """
    wish = read_wish(file)
    for note in wish.notes:
        session.tell.note(f"{file}:{note.mark.line}:{note.mark.column}: {note.text}")
    wish = of_nodes(session, file, wish, named_nodes(session))
    tell_unknown_bit_rate(session, len(wish.nodes))
    log = FileLog(file, network_text(file))
    plan = plan_wish(session, wish, log, trust_stamp=trust_stamp, as_far=as_far, of_network=True)
    undescribed = [node.node_id for node in plan.nodes if session.node(node.node_id).dictionary is None]
    if undescribed:
        session.tell.note(f"{file}: {skipped_rules(undescribed)}")
    return plan


def plan_wish(
    session: Session,
    wish: NetworkWish,
    log: FileLog,
    *,
    trust_stamp: bool = False,
    as_far: bool = False,
    of_network: bool = False,
    failures: list[DvtcliError] | None = None,
) -> NetworkPlan:
    """What has to be written for the nodes of *wish* to hold what it says; what it cannot mean is told to *log*.

    With *of_network* the rules of networks are asked, too, of the state that the plan leaves.
    *trust_stamp*, *as_far* and what is raised as of `plan_network`; if *failures* is given, what would be raised is put
    there, and the plan has all that can be planned.
    """
    with (
        short_frames(session.bus) as frames,
        heard_ids(session.bus) as heard,
        session.network.as_it_was_if_refused(),
    ):
        plan = _planned_wish(session, wish, log, trust_stamp=trust_stamp, of_network=of_network, failures=failures)
        if not as_far and failures is None:
            refuse_lacking(plan)
        refuse_heard(session, plan, heard, placed_in(wish, log))
    return with_unknown_syncs(session, replace(plan, has_sync_master=_master_syncs(wish)), frames)


def refuse_heard(session: Session, plan: NetworkPlan, heard: HeardIds, placed: Placed) -> None:
    """RuleError if a TPDO of *plan* is to get a CAN-ID that somebody unknown was *heard* to send, unless forced.

    *placed* gives a finding its place in the file.
    """
    refused: list[RuleError] = []
    for node in plan.nodes if heard.bus is not None and not session.options.force else ():
        changes = [change for change in node.plan.changes if isinstance(change, PdoChange)]
        held = {pdo: (want, want) for pdo, want in node.wanted.items()}  # unless the plan changes it
        pdos = held | {change.pdo: (change.before, change.after) for change in changes}
        findings = heard_producer_findings(session.node(node.node_id), pdos, heard)
        if found := [placed(node.node_id, finding) for finding in findings]:
            refused.append(RuleError(f"node {node.node_id}: {found[0].text}", found, node=node.node_id))
    if refused:
        raise together(refused)


def checked_network(session: Session, plan: NetworkPlan, heard: HeardIds, *, of_device: bool) -> NetworkPlan:
    """*plan* of a file that names no network, a saved plan or one *of_device*, with what the rules of networks say.

    RuleError if they find an error, or a TPDO gets a CAN-ID that somebody unknown was *heard* to send, unless forced.
    """
    wish = NetworkWish(tuple(NodeWish(node.name, node.node_id) for node in plan.nodes))
    plan = judged_network(session, plan, wish, FileLog(plan.file, ""), of_device=of_device)
    if (refused := refusals(plan.nodes)) and not session.options.force:
        raise together(refused)
    refuse_heard(session, plan, heard, in_objects(plan.nodes))
    return plan


def _master_syncs(wish: NetworkWish) -> bool:
    return wish.master is not None and bool(wish.master.sync_period_us)


def with_unknown_syncs(session: Session, plan: NetworkPlan, frames: ShortFrames) -> NetworkPlan:
    """*plan* with SYNC among *frames* that nobody who is known sends; what is new of that is told."""
    if plan.has_sync_master:
        return plan
    found = unknown_syncs(frames, [session.network.nodes[node_id] for node_id in sorted(session.network.nodes)])
    for can_id in found:
        if can_id not in plan.unknown_syncs:
            session.tell.note(sync_note(can_id))
    return replace(plan, unknown_syncs=tuple(sorted({*plan.unknown_syncs, *found})))


def _planned_wish(
    session: Session,
    wish: NetworkWish,
    log: FileLog,
    *,
    trust_stamp: bool,
    of_network: bool,
    failures: list[DvtcliError] | None,
) -> NetworkPlan:
    met = meet(session, log.file, wish)
    unread = trusted(met.nodes, wish) if trust_stamp else frozenset()
    planned: list[NodePlan] = []
    lacked = LackedOfWish(log)
    try:
        read, lacked = without_lacked(met.nodes, wish.of(met.nodes.keys() - unread), log)
        planned = _judged(session, met, read, log)
    except (InputFileError, RuleError, NoAnswer, SdoProtocolError) as failed:
        met.failures.append(failed)
    planned += (_unread(met.nodes[node.node_id], node) for node in wish.nodes if node.node_id in unread)
    nodes = (
        _with_nothing_asked(
            replace(node_plan, lacks=lacked.of(node_plan.node_id), boot_ups=met.boot_ups[node_plan.node_id]), wish, log
        )
        for node_plan in sorted(planned, key=lambda planned_node: planned_node.node_id)
    )
    plan = NetworkPlan(log.file, tuple(nodes), lacking=tuple(lacked.found), torn=lacked.torn)
    if of_network and all(isinstance(failure, RuleError | InputFileError) for failure in met.failures):
        plan = judged_network(session, plan, wish, log)
    if not session.options.force:
        met.failures += refusals(plan.nodes)
    if (met.failures or failures is not None) and lacked.found:
        lacking = lacking_error(lacked.found)
        lacking.findings = tuple(
            replace(missing_object.finding, complaint=missing_object.complaint) for missing_object in lacked.found
        )
        met.failures.append(lacking)
    if failures is None:
        met.end()
    else:
        failures += met.failures
    return plan


def _with_nothing_asked(planned: NodePlan, wish: NetworkWish, log: FileLog) -> NodePlan:
    """*planned* with a warning if the file of *wish* says nothing that the node should hold."""
    if not planned.is_asked_nothing or planned.node_id not in wish.asked_nothing:
        return planned
    found = warning("asked-nothing", "", ASKS_NOTHING)
    return replace(planned, findings=(*planned.findings, placed_in(wish, log)(planned.node_id, found)))


def _unread(node: Node, wish: NodeWish) -> NodePlan:
    """Nothing is to be done about *node*, which was not read."""
    plan = Plan(node.node_id, ())
    return NodePlan(wish.name, plan, node.identity(), node.title, wish.mark.line, is_read=False)


def _judged(session: Session, met: IdentifiedNodes, wish: NetworkWish, log: FileLog) -> list[NodePlan]:
    """The plan of each node that was met; what is wrong is put to its failures.

    If a node's words mean nothing there, the others are judged all the same, and its own PDOs that mean something.
    """
    nodes = met.nodes
    said: Mapping[int, tuple[Finding, ...]] = {}
    stamps, placed = stamps_of(nodes, wish), placed_in(wish, log)
    try:
        if wish.links:
            found = with_links(nodes, _known(session, nodes), wish)
            wish, said = found.wish, found.findings
    except RuleError as refused:
        refused.findings = tuple(placed(refused.node, finding) for finding in refused.findings)
        met.failures.append(refused)
    wants = {}
    for node in wish.nodes:
        wants[node.node_id] = node_wants(nodes[node.node_id], node, log)
    planned, refusals = plans_of(nodes, wish, wants, stamps)
    for error in refusals:
        error.findings = tuple(placed(error.node, finding) for finding in error.findings)
        met.failures.append(error)
    planned = [replace(plan, findings=(*said.get(plan.node_id, ()), *plan.findings)) for plan in planned]
    planned = judged(nodes, planned, force=session.options.force, placed=placed)
    try:
        refuse_stores_of(nodes, wish, log)
    except RuleError as refused:
        met.failures.append(refused)
    try:
        log.end(read=True)
    except InputFileError as wrong:
        met.failures.append(wrong)
    return planned


def _known(session: Session, nodes: Mapping[int, Node]) -> Iterator[Node]:
    """The other nodes that this session knows and that answer: what they use is not free."""
    for node_id in session.known_ids():
        with suppress(NoAnswer, SdoProtocolError):  # a node that is off hinders no change of another one
            if node_id not in nodes:
                session.network.node(node_id).known_cob_ids()
                yield session.network.node(node_id)


def plans_of(
    nodes: Mapping[int, Node], wish: NetworkWish, wants: Mapping[int, NodeWants], stamps: Mapping[int, Stamp]
) -> tuple[list[NodePlan], list[RuleError]]:
    """What brings each of *nodes* to its *wants*, not judged yet, and why PDOs are left out of it."""
    senders = Senders(
        nodes, {wanted_node.node_id: {pdo.pdo: _said(pdo) for pdo in wanted_node.pdos} for wanted_node in wish.nodes}
    )
    refused: list[RuleError] = []
    read_side_by_side(nodes.values(), [partial(_look_ahead, nodes[node_id], want) for node_id, want in wants.items()])
    found = [_differences(nodes[node.node_id], wants[node.node_id], senders, refused) for node in wish.nodes]
    read_side_by_side(
        nodes.values(),
        [partial(_look_at_stamp, nodes[one.node_id], stamps.get(one.node_id), one.changes) for one in found],
    )
    planned = [
        _node_plan(nodes[node.node_id], node, wants[node.node_id], differences, stamps.get(node.node_id))
        for node, differences in zip(wish.nodes, found, strict=True)
    ]
    return planned, refused


def _look_ahead(node: Node, wants: NodeWants) -> None:
    """Read what the plan of *node* needs; what cannot be read is told where it is needed."""
    with suppress(DvtcliError):
        node.observed(lambda: [node.known_pdo(pdo) for pdo in wants.pdos])
        node.observed(lambda: [node.known_value(*place) for place in wants.values])


def _look_at_stamp(node: Node, stamp: Stamp | None, changes: Sequence[Change]) -> None:
    """The same of what the stamp of *node* becomes with *changes*."""
    with suppress(DvtcliError):
        stamping(node, stamp, changes)


def _said(wish: PdoWish) -> CobId | None:
    """The COB-ID that the file itself names, while it is not known yet what the others will come to."""
    if not isinstance(wish.cob_id, int) or wish.enabled is False:
        return None
    return CobId(wish.cob_id, extended=wish.extended)


class _Differences(NamedTuple):
    """What a node's PDOs are to be, the *changes* that make them and its values so, and what `auto` chose instead."""

    node_id: int
    wanted: dict[Pdo, PdoConfig]
    changes: tuple[Change, ...]
    instead: tuple[Finding, ...]


def _differences(node: Node, wants: NodeWants, senders: Senders, refused: list[RuleError]) -> _Differences:
    """What *node* is to be, without the PDOs of which *refused* gets why they cannot be made."""
    elsewhere = cache(partial(senders.besides, node.node_id))
    lengths = untyped_lengths(node, wants.pdos.values())
    now = node.observed(lambda: {pdo: node.known_pdo(pdo) for pdo in wants.pdos})
    wanted: dict[Pdo, PdoConfig] = {}
    for pdo, want in wants.pdos.items():
        try:
            wanted[pdo] = resolve(node, pdo, now[pdo], want, lengths, elsewhere)
        except RuleError as error:
            refused.append(error)
    senders.after[node.node_id] = {pdo: config.communication.cob_id for pdo, config in wanted.items()}
    held = node.observed(lambda: {place: node.known_value(*place) for place in wants.values})
    values = _values(node, wants, held)
    pdos = [plan_pdo(pdo, now[pdo], want) for pdo, want in wanted.items()]
    proposed = (
        (wants.pdos[pdo], proposal(node, pdo, now[pdo], want, wanted, elsewhere, senders.channels))
        for pdo, want in wanted.items()
    )
    instead = (finding for want, pdo_proposal in proposed for finding in instead_findings(want, pdo_proposal))
    changes: tuple[Change, ...] = (*values, *(change for change in pdos if change.steps))
    return _Differences(node.node_id, wanted, changes, tuple(instead))


def _node_plan(
    node: Node, wish: NodeWish, wants: NodeWants, differences: _Differences, stamp: Stamp | None
) -> NodePlan:
    """The plan of *node*, which ends its stamp or gives it *stamp*."""
    wanted, changes = differences.wanted, differences.changes
    stamped = stamping(node, stamp, changes)
    plan = Plan(node.node_id, (*stamped.changes, *changes))
    return NodePlan(
        wish.name, plan, node.identity(), node.title, wish.mark.line, str(wish.store or ""), wanted,
        {**wants.values, **stamped.values}, wants.pruned,
        lines={pdo.pdo: pdo.mark.line for pdo in wish.pdos}, object_lines=dict(wants.lines),
        names=names(node, plan.changes), understood=understood(node, plan.changes),
        unstored=_unstored(node, plan) if wish.store else (),
        findings=(*stamped.findings, *differences.instead, *_left_off(wish, wanted)),
    )  # fmt: skip


def _left_off(wish: NodeWish, wanted: Mapping[Pdo, PdoConfig]) -> Iterator[Finding]:
    """A warning for each PDO that gets a mapping or a timer and stays off, and that the file does not call off."""
    for pdo in wish.pdos:
        sets = [name for name, value in (("a mapping", pdo.mapping), ("an event timer", pdo.event_timer)) if value]
        if sets and pdo.enabled is None and pdo.pdo in wanted and not wanted[pdo.pdo].enabled:
            given = " and ".join(sets)
            text = f"{pdo.pdo.label} is off and stays off: the file gives it {given}"
            hint = "enabled: true in the file switches it on; enabled: false says that it is meant to stay off"
            yield warning("mapped-but-off", f"0x{pdo.pdo.communication_index:04X}:01", text, hint)


def _values(node: Node, wants: NodeWants, held: Mapping[ObjectAddress, bytes]) -> list[ValueChange]:
    """The values that differ; and a SYNC period that is held and has to be 0 while the counter's overflow changes."""
    wanted = {**_period_kept(node, wants, held), **wants.values}
    changes = {
        place: value_change(node, place, held.get(place, data), data, wants.reasons.get(place, "write"))
        for place, data in wanted.items()
    }
    return [changes[step.index, step.sub_index] for step in altering(change.step for change in changes.values())]


def _period_kept(node: Node, wants: NodeWants, held: Mapping[ObjectAddress, bytes]) -> Mapping[ObjectAddress, bytes]:
    """The node's SYNC period, where nobody wants another one and it is in the way of what is wanted."""
    overflow, period = (SYNC_OVERFLOW, 0), (SYNC_PERIOD, 0)
    if period in wants.values or held.get(overflow) == wants.values.get(overflow):
        return {}
    number = node.observed(lambda: read_optional(node.memory, *period, 4))
    return {period: number.to_bytes(4, "little")} if number else {}


def _unstored(node: Node, plan: Plan) -> tuple[str, ...]:
    """Labels of what *node* holds and no store is known to have taken, whoever of dvtcli set it.

    Not what *plan* changes: what that was need not be stored, and what it will be may be what is stored.
    """
    remembered = {} if node.keeper is None else held_unstored(node, node.keeper.past, node.identity())
    changed = {change.label for change in plan.changes}
    return tuple(label for label in {**remembered, **node.unstored} if label not in changed)


def value_change(node: Node, place: tuple[int, int], held: bytes, data: bytes, reason: str) -> ValueChange:
    """The change of the object at *place* of *node* from *held* to *data*."""
    return ValueChange(Step(*place, held, data, reason, names_object=names_objects(node, *place)))
