"""Judge the plan of a whole network before its first write. Writes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

from dvtcli.device.other_producers import Senders
from dvtcli.device.proposal import proposal
from dvtcli.device.raw_write import raw_write_findings
from dvtcli.device.virtual_pdos import tie_findings
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.hint import Action, Hint, has_place, sentence
from dvtcli.domain.network.consumers import Id, Sent, left_findings, length_findings, moved_tpdos, sent_by_id
from dvtcli.domain.network.network_plan import NodePlan
from dvtcli.domain.objects import CONCISE_DCF
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import PdoChange, ValueChange
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.domain.rules.finding import Finding, finding_of
from dvtcli.errors import RuleError
from dvtcli.operations.plans.read_network_config import named_nodes
from dvtcli.operations.results.failures import together

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.check.checked_network import NetSpot
    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.domain.network.network_plan import NetworkPlan
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.files.network.file_log import FileLog
    from dvtcli.operations.session.session import Session

    Placed = Callable[[int | None, Finding], Finding]

ERROR, WARNING = Severity.ERROR, Severity.WARNING


def check_plans(nodes: Mapping[int, Node], node_plans: Iterable[NodePlan], *, force: bool) -> Iterator[NodePlan]:
    """Judge *node_plans* as a whole and add the questions to ask.

    Raises RuleError with all errors of all nodes, and InputFileError for an invalid concise DCF (0x1F22), unless
    forced.
    """
    node_plans = list(node_plans)
    found = judge_plans(nodes, node_plans, force=force, placed=in_objects(node_plans))
    if (refused := refusals(found)) and not force:
        raise together(refused)
    return iter(found)


def judge_plans(
    nodes: Mapping[int, Node], node_plans: Iterable[NodePlan], *, force: bool, placed: Placed | None = None
) -> list[NodePlan]:
    """Judge *node_plans* as a whole; errors are added as findings, and so are the questions to ask.

    *placed* gives a finding its place in a file. Raises InputFileError for an invalid concise DCF (0x1F22), unless
    forced.
    """
    node_plans = [_doubted(nodes[node_plan.node_id], node_plan, force=force) for node_plan in node_plans]
    after = {node_plan.node_id: _cob_ids(node_plan) for node_plan in node_plans}
    senders = Senders(nodes, after)
    if any(
        pdo.is_tpdo and cob_id is not None and cob_id.valid for ids in after.values() for pdo, cob_id in ids.items()
    ):
        senders.read_ahead([node_id for node_id, ids in after.items() if ids])
    sent = sent_by_id(node_plans)
    found = [
        replace(node_plan, findings=(*node_plan.findings, *_all_findings(nodes, node_plan, sent, senders)))
        for node_plan in node_plans
    ]
    if placed is None:
        return found
    return [
        replace(node_plan, findings=tuple(placed(node_plan.node_id, finding) for finding in node_plan.findings))
        for node_plan in found
    ]


def refusals(node_plans: Iterable[NodePlan]) -> list[RuleError]:
    """Make an error for each node of *node_plans* with findings of severity error."""
    return [
        RuleError(f"node {node_plan.node_id}: {errors[0].text}", errors, node=node_plan.node_id)
        for node_plan in node_plans
        if (errors := errors_in(node_plan.findings))
    ]


def placed_in(config: NetworkConfig, log: FileLog) -> Placed:
    """Give findings about nodes of *config* their places in its file."""

    def placed(node_id: int | None, finding: Finding) -> Finding:
        mark = config.mark_of(node_id, finding.place)
        if finding.complaint is not None or not mark.line:
            return finding
        return replace(finding, complaint=log.shown(mark, finding.text), hint=in_keys(finding.hint))

    return placed


#: actions of hints -> the equivalent key of a network file
_KEYS = {
    Action.SELECT_CAN_ID: "`cob_id: auto`",
    Action.EXTEND: "bit 29 of `cob_id` (0x20000000)",
    Action.MAP: "`mapping:` of {}",
    Action.DISABLE: "`enabled: false` of {}",
    Action.LEAVE_OFF: "`enabled: false`",
    Action.ALLOW_RTR: "`rtr_allowed: true`",
    Action.FORBID_RTR: "`rtr_allowed: false`",
    Action.GIVE_EDS: "`dcf: FILE`",
}


#: actions of hints -> the equivalent in a PDO's COB-ID
_BITS = {
    Action.EXTEND: "bit 29 set",
    Action.ALLOW_RTR: "bit 30 clear",
    Action.FORBID_RTR: "bit 30 set",
    Action.LEAVE_OFF: "bit 31 set",
}


def in_keys(hint: Hint | str | None) -> Hint | str | None:
    """Replace actions in *hint* by the keys of a network file, if it has such keys."""
    return _each_step(hint, _step_in_keys)


def _each_step(hint: Hint | str | None, change: Callable[[Hint], Hint]) -> Hint | str | None:
    if not isinstance(hint, Hint):
        return hint
    first, *others = (change(replace(step, then=None)) for step in hint)
    return sum(others, start=first)


def in_objects(node_plans: Sequence[NodePlan]) -> Placed:
    """Give findings of a file of object values the object where their hints apply."""
    wanted = {(node_plan.node_id, pdo) for node_plan in node_plans for pdo in node_plan.wanted}

    def placed(node_id: int | None, finding: Finding) -> Finding:
        at = _in_file(finding.pdo) or f"at {finding.place} in the file"

        def in_file(step: Hint) -> Hint:
            if step.action is Action.DISABLE:
                other = step.arguments.get("node", node_id), Pdo.parse(str(step.arguments["pdo"]))
                if other not in wanted:
                    return step
                words = f"bit 31 set {_in_file(other[1])}"
                return _said_together(step, words)
            if step.action is Action.SELECT_CAN_ID:
                first, alternative, behind = step.why.partition(", or {}")
                if alternative and not behind:  # "take another CAN-ID" is all that a file can do
                    return Hint(None, why=f"{first} {at}")
                words = f"{step.arguments.get('can_id', 'another CAN-ID')}"
            elif step.action in _BITS:
                words = _BITS[step.action]
            else:
                return step
            return Hint(None, why=sentence(step, lambda _step: f"{words} {at}"))

        return replace(finding, hint=_each_step(finding.hint, in_file))

    return placed


def _in_file(pdo: Pdo | None) -> str:
    return "" if pdo is None else f"at 0x{pdo.communication_index:04X}:01 in the file"


def _step_in_keys(step: Hint) -> Hint:
    key = None if step.action is None else _KEYS.get(step.action)
    if key is None:
        return step
    node, pdo = step.arguments.get("node"), step.arguments.get("pdo")
    words = key.format(f"{node}:{pdo}" if node else pdo)
    if step.action is Action.MAP and (objects := step.arguments.get("objects")):
        words = words.replace("mapping:", f"mapping: [{', '.join(objects)}]")
    return _said_together(step, words)


def _said_together(step: Hint, words: str) -> Hint:
    """Put *words* for the action of *step*, without a first step: a file is carried out as a whole."""
    why = step.why if has_place(step.why) else f"{{}} {step.why}".rstrip()
    return Hint(None, why=sentence(replace(step, why=why.replace("{} first", "{}")), lambda _step: words))


def _doubted(node: NodeDescription, node_plan: NodePlan, *, force: bool) -> NodePlan:
    """Add the question about what the node, as a manager, would download to others."""
    steps = [change.step for change in node_plan.plan.changes if isinstance(change, ValueChange)]
    concise = {step.sub_index: step.after for step in steps if step.index == CONCISE_DCF and step.sub_index}
    if not concise:
        return node_plan
    from dvtcli.operations.session.consent import concise_doubts

    doubt = concise_doubts(node, concise, force=force)
    return replace(node_plan, doubt="; ".join(filter(None, (node_plan.doubt, doubt))))


def _all_findings(
    nodes: Mapping[int, ReadableNode], node_plan: NodePlan, sent: Mapping[Id, Iterable[Sent]], senders: Senders
) -> Iterator[Finding]:
    yield from _findings(nodes[node_plan.node_id], node_plan, senders)
    yield from length_findings(node_plan, sent)
    if moved := moved_tpdos(node_plan):
        yield from left_findings(node_plan, moved, senders.sent(), senders.received())


def _cob_ids(node_plan: NodePlan) -> dict[Pdo, CobId | None]:
    changes = (change for change in node_plan.plan.changes if isinstance(change, PdoChange))
    return {change.pdo: change.after.communication.cob_id for change in changes}


def _findings(node: ReadableNode, node_plan: NodePlan, senders: Senders) -> Iterator[Finding]:
    together: dict[Pdo, PdoConfig] = dict(node_plan.wanted)
    changes = node_plan.plan.changes
    together |= {change.pdo: change.after for change in changes if isinstance(change, PdoChange)}
    for change in changes:
        if isinstance(change, PdoChange):
            same = partial(senders.besides_with, node.node_id, change.after.communication.cob_id)
            proposed = proposal(node, change.pdo, change.before, change.after, together, same, senders.channels)
            yield from check_pdo(proposed)
        else:
            step = change.step
            yield from raw_write_findings(node, step.index, step.sub_index, step.after)
            yield from tie_findings(node, step.index, step.sub_index, step.after)


def judge_network(
    session: Session, network_plan: NetworkPlan, config: NetworkConfig, log: FileLog, *, of_device: bool = False
) -> NetworkPlan:
    """Judge the state after *network_plan* by the rules of networks: errors, and warnings about what *config* names.

    Returns *network_plan* with the findings, at their places in the file of *log*. Reads the nodes of the plan, except
    those that it skips for their stamp; CAN-IDs of the session's other nodes count, too. If the plan has not all nodes
    of the file, there are errors only: a warning may be wrong without the others. An error about what the plan does not
    change becomes a warning if its rule is about one device, and with *of_device* (the file of one device) for every
    rule.
    """
    from dvtcli.domain.network.check.checked_network import CheckedNetwork, mark_of
    from dvtcli.domain.network.check.network_rules import (
        NETWORK_RULES,
        OF_COB_IDS,
        OF_ONE_DEVICE,
        SAME_RULES,
        SUPERSEDED,
        network_findings,
    )
    from dvtcli.operations.plans.network_states import network_after, states_beside, states_of, with_link_marks

    read = [node_plan.node_id for node_plan in network_plan.nodes if node_plan.is_read]
    if not read or network_plan.lacking:
        return network_plan
    is_complete = all(node.mark.line for node in config.nodes) and not network_plan.unread and not named_nodes(session)
    bit_rate = session.wire.bitrate or session.options.bitrate
    state = network_after(states_of(session, [session.node(read_id) for read_id in read]), network_plan, config)
    state = with_link_marks(state, config.links)
    found: dict[int, dict[Finding, None]] = {}
    said = {
        (node_plan.node_id, finding.pdo, finding.rule)
        for node_plan in network_plan.nodes
        for finding in node_plan.findings
    }
    texts = {(node_plan.node_id, finding.text) for node_plan in network_plan.nodes for finding in node_plan.findings}
    superseded: set[tuple[int, Pdo | None, str]] = set()
    changed = {(node_plan.node_id, what) for node_plan in network_plan.nodes for what in _changed(node_plan)}
    network = CheckedNetwork(state, bit_rate or state.bit_rate)
    findings = network_findings(network, {rule.name for rule in NETWORK_RULES})
    if beside := states_beside(session, read):
        network = replace(network, state=state._replace(nodes=(*beside, *state.nodes)))
        more = (more_found for more_found in network_findings(network, OF_COB_IDS) if more_found[1].node_id in read)
        findings = chain(findings, more)
    for rule, spot, text in findings:
        node_id = spot.node_id or read[0]
        node = state.node(node_id)
        is_named = spot.pdo is None or node is None or spot.pdo in node.marks
        same = SAME_RULES.get(rule.name)
        if same and any((node_id, spot.pdo, name) in said for name in (rule.name, *same)):
            continue
        superseded |= {(node_id, spot.pdo, name) for name in SUPERSEDED.get(rule.name, ())}
        is_changed = (node_id, spot.index if spot.pdo is None else spot.pdo) in changed
        is_unchanged = (of_device or rule.name in OF_ONE_DEVICE) and not is_changed
        severity = WARNING if is_unchanged and rule.severity is ERROR else rule.severity
        counts = severity is ERROR or (severity is WARNING and is_named and is_complete)
        if counts and (node_id, text) not in texts:
            label = "" if spot.pdo is None or text.startswith(spot.pdo.label) else f"{spot.pdo.label}: "
            words = text if severity is rule.severity else f"{text}; the node already has it"
            hint = rule.hint if rule.hint and any(held.mark.line for held in config.nodes) else None
            finding = finding_of(rule.name, severity, _place(spot, network_plan.file), f"{label}{words}", hint)
            mark = mark_of(state, spot)
            complaint = log.shown(mark, words) if mark.line else None
            found.setdefault(node_id, {})[replace(finding, complaint=complaint)] = None
    nodes = []
    for node_plan in network_plan.nodes:
        kept = (each for each in node_plan.findings if (node_plan.node_id, each.pdo, each.rule) not in superseded)
        nodes.append(replace(node_plan, findings=(*kept, *found.get(node_plan.node_id, ()))))
    return replace(network_plan, nodes=tuple(nodes))


def _changed(node_plan: NodePlan) -> set[Pdo | int]:
    """List the PDOs that *node_plan* changes, even by a single parameter, and the indices of other objects."""
    changes = node_plan.plan.changes
    return {
        change.pdo if isinstance(change, PdoChange) else Pdo.at(change.step.index) or change.step.index
        for change in changes
    }


def _place(spot: NetSpot, file: str) -> str:
    """Name *spot* for a finding: an object, else *file*."""
    if spot.index is not None:
        return f"0x{spot.object}"
    if spot.pdo is not None:
        return f"0x{spot.pdo.communication_index:04X}:01"
    return "" if spot.node_id is not None else file
