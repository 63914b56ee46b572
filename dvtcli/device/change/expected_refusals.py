"""PDO configurations that a node is expected to refuse in a roll-back, and what it accepts in place of each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, Plan, alters
from dvtcli.domain.rules.finding import Finding, Proposal
from dvtcli.domain.rules.no_way_back import substitute_finding, way_back

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription


def with_undo_findings(node: NodeDescription, plan: Plan) -> tuple[Plan, tuple[Finding, ...]]:
    """*plan* with an accepted substitute for each PDO value that *node* would refuse in a roll-back, and findings."""
    found = [_foreseen(node, change) for change in plan.changes]
    findings = tuple(finding for _, finding in found if finding is not None)
    return replace(plan, changes=tuple(change for change, _ in found)), findings


def _foreseen(node: NodeDescription, change: Change) -> tuple[Change, Finding | None]:
    if not isinstance(change, PdoChange) or not change.steps or not alters(change):
        return change, None
    back = Proposal(
        node_id=node.node_id,
        pdo=change.pdo,
        now=change.after,
        want=change.before,
        others={},
        profile=node.profile,
        dictionary=node.dictionary,
    )
    found = way_back(back)
    return (change, None) if found is None else (change._replace(substitute=found[0]), found[1])


def substitute_findings(changes: Iterable[Change]) -> tuple[Finding, ...]:
    """A warning for each of *changes* restored to a substitute value."""
    return tuple(
        substitute_finding(change.pdo, change.before, change.substitute)
        for change in changes
        if isinstance(change, PdoChange) and change.substitute is not None
    )


def foreseen(plans: Iterable[Plan]) -> list[PdoChange]:
    """The first change of each PDO in *plans* (oldest first) with an expected refusal of the roll-back."""
    first: dict[Pdo, PdoChange] = {}
    for change in (change for plan in plans for change in plan.changes):
        if isinstance(change, PdoChange):
            first.setdefault(change.pdo, change)
    return [change for change in first.values() if change.substitute is not None]
