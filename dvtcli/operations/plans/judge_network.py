"""What the rules say of a whole network's plan, before anything of it is written. Writes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

from dvtcli.device.proposal import proposal
from dvtcli.device.raw_write_check import raw_write_findings
from dvtcli.device.senders import Senders
from dvtcli.device.virtual_pdos import tie_findings
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.consumers import Id, Sent, left_findings, length_findings, moved_tpdos, sent_by_id
from dvtcli.domain.network.network_plan import NodePlan
from dvtcli.domain.network.network_state import CONCISE_DCF
from dvtcli.domain.plan import PdoChange, ValueChange
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.errors import RuleError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.rules import Finding


def checked(nodes: Mapping[int, Node], planned: Iterable[NodePlan], *, force: bool) -> Iterator[NodePlan]:
    """*planned* with what the rules say of it as a whole, and what is to be asked about it.

    RuleError with all errors of all nodes, and InputFileError for a concise DCF (0x1F22) that is none, unless forced.
    """
    planned = [_doubted(nodes[one.node_id], one, force=force) for one in planned]
    after = {one.node_id: _cob_ids(one) for one in planned}
    senders = Senders(nodes, after)
    sent = sent_by_id(planned)
    judged = [replace(one, findings=(*one.findings, *_all_findings(nodes, one, sent, senders))) for one in planned]
    refused = [
        RuleError(f"node {one.node_id}: {errors[0].text}", errors, node=one.node_id)
        for one in judged
        if (errors := errors_in(one.findings))
    ]
    if refused and not force:
        raise together(refused)
    return iter(judged)


def _doubted(node: Node, planned: NodePlan, *, force: bool) -> NodePlan:
    """*planned* with the question about what its node, as a manager, is to download to others."""
    steps = [change.step for change in planned.plan.changes if isinstance(change, ValueChange)]
    concise = {step.sub_index: step.after for step in steps if step.index == CONCISE_DCF and step.sub_index}
    if not concise:
        return planned
    from dvtcli.operations.consent.concise_consent import concise_doubts

    doubt = concise_doubts(node, concise, force=force)
    return replace(planned, doubt="; ".join(filter(None, (planned.doubt, doubt))))


def _all_findings(
    nodes: Mapping[int, Node], one: NodePlan, sent: Mapping[Id, Iterable[Sent]], senders: Senders
) -> Iterator[Finding]:
    yield from _findings(nodes[one.node_id], one, senders)
    yield from length_findings(one, sent)
    if moved := moved_tpdos(one):
        yield from left_findings(one, moved, senders.sent(), senders.heard())


def _cob_ids(plan: NodePlan) -> dict[Pdo, CobId | None]:
    changes = (change for change in plan.plan.changes if isinstance(change, PdoChange))
    return {change.pdo: change.after.communication.cob_id for change in changes}


def _findings(node: Node, planned: NodePlan, senders: Senders) -> Iterator[Finding]:
    together: dict[Pdo, PdoConfig] = dict(planned.wanted)
    changes = planned.plan.changes
    elsewhere = cache(partial(senders.besides, node.node_id))
    together |= {change.pdo: change.after for change in changes if isinstance(change, PdoChange)}
    for change in changes:
        if isinstance(change, PdoChange):
            yield from check_pdo(proposal(node, change.pdo, change.before, change.after, together, elsewhere))
        else:
            step = change.step
            yield from raw_write_findings(node, step.index, step.sub_index, step.after)
            yield from tie_findings(node, step.index, step.sub_index, step.after)


def together(refused: list[RuleError]) -> RuleError:
    """One error with the findings of all nodes."""
    if len(refused) == 1:
        return refused[0]
    findings = [
        replace(finding, text=f"node {error.node}: {finding.text}") for error in refused for finding in error.findings
    ]
    return RuleError(findings[0].text, findings)
