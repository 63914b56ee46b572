"""Edit a node's PDOs: what the rules say, the plan, and the change, as `map` makes it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dvtcli.device.change.change_guard import who_else
from dvtcli.device.proposal import proposal
from dvtcli.domain.hint import as_hint
from dvtcli.domain.plan import Plan, plan_pdo
from dvtcli.domain.rules import check_pdo
from dvtcli.domain.text import join_some
from dvtcli.errors import SafetyRefusal
from dvtcli.operations.changes.change import configure, names, understood
from dvtcli.operations.results import Changed

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.rules import Finding
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes

#: PDOs with their configurations
Configs = Mapping["Pdo", "PdoConfig"]


def judge_edited(node: ReadableNode, held: Configs, changed: Configs) -> dict[Pdo, tuple[Finding, ...]]:
    """Return what the rules say of each of *changed* PDOs of *node*, which *held* others before."""
    return {pdo: check_pdo(proposal(node, pdo, held[pdo], want, changed)) for pdo, want in changed.items()}


def plan_edited(session: Session, node_id: int, held: Configs, changed: Configs) -> Changed:
    """Return what `map` would write, tried on the node's twin; under --dry-run planned only, as the twin stays."""
    if session.dry_run:
        node = session.node(node_id)
        plan = edited_plan(node_id, held, changed)
        said = names(node, plan.changes), understood(node, plan.changes)
        findings = tuple(finding for found in judge_edited(node, held, changed).values() for finding in found)
        return Changed(node_id, plan, findings, dry_run=True, seconds=0.0, names=said[0], understood=said[1])
    with session.under(dry_run=True):
        return configure(session, session.node(node_id), changed)


def apply_edited(session: SessionNodes, node: Node, held: Configs, changed: Configs) -> Changed:
    """Write the *changed* PDOs as `map` does; raises SafetyRefusal if *node* no longer has what it *held*."""
    node.begin_change()
    others = [pdo.label for pdo in changed if node.pdo(pdo) != held[pdo]]
    if others:
        raise SafetyRefusal(
            f"{join_some(others)} of node {node.node_id} is not what it was when the editor read it",
            node=node.node_id,
            hint=as_hint(f"{who_else(node.guard)}: look at it again before it is written"),
        )
    return configure(session, node, changed)


def edited_plan(node_id: int, held: Configs, changed: Configs) -> Plan:
    """Return the writes that make the *changed* PDOs of what the node *held*."""
    return Plan(node_id, tuple(plan_pdo(pdo, held[pdo], want) for pdo, want in changed.items()))
