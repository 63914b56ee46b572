"""Write a session's net changes as gateway lines (CiA 309-3), for `save x.309`. Writes nothing to a node."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.store.store_parameters import chosen
from dvtcli.domain.gateway_requests import Around, plan_lines
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import STORE_PARAMETERS
from dvtcli.domain.plan import PdoChange, Plan, ValueChange, alters, plan_pdo
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import UsageError
from dvtcli.operations.changes.possible_stores import store_group
from dvtcli.operations.results import Facts
from dvtcli.operations.session.consent import refuse_powered
from dvtcli.operations.session.save_script import ask_before_overwriting, ended_lines, make_file, place_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.plan import Change
    from dvtcli.operations.session.session import SessionNodes


def plan_as_lines(session: SessionNodes, plan: NetworkPlan, stores: Mapping[int, Sequence[str]] | None = None) -> str:
    """Return *plan* as gateway lines; *stores* by node-ID if a node has several.

    Asks as `apply` does for another device than in the file; raises SafetyRefusal if a power stage is enabled.
    """
    planned = [node for node in plan.nodes if len(node.plan) or node.stores]
    refuse_powered(session, [planned_node.node_id for planned_node in planned if planned_node.needs_power_off])
    for node_plan in planned:
        if node_plan.doubt:
            session.consent(f"{node_plan.doubt}; write the lines for it?")
    several = stores or {}
    around = {node.node_id: _around(session, node, several.get(node.node_id, (node.store,))) for node in plan.nodes}
    return "\n".join([*plan_lines(plan, around), ""])


def _around(session: SessionNodes, planned: NodePlan, stores: Sequence[str]) -> Around:
    node = session.node(planned.node_id)
    if not (len(planned.plan) or planned.stores):
        return Around()
    required = node.is_pre_operational_wanted
    groups = [store_group(word) for word in stores] if planned.stores else []
    chose = (chosen(node.access, node.profile.store, STORE_PARAMETERS, group, node.dictionary)[0] for group in groups)
    return Around(required, required and node.access.state() is NmtState.OPERATIONAL, tuple(dict.fromkeys(chose)))


SUFFIX = ".309"
#: Script lines that no gateway's client sends: the device decides who may write, `load` needs a reset.
_UNSAID = ("login", "fpo", "restore")


def save_lines(session: SessionNodes, file: str) -> Facts:
    """Write the net changes of this session to *file* as CANopen gateway lines.

    Asks before overwriting. Raises UsageError if there are no changes, if gateway lines cannot express them, or if the
    file cannot be written.
    """
    path = place_of(file, f"NAME{SUFFIX}")
    sections = ended_lines(session)
    stores = {node_id: _stores(lines) for node_id, lines in sections}
    nodes = tuple(
        _planned(session.node(node_id), session.record.of(node_id), stores[node_id]) for node_id, _ in sections
    )
    plan = NetworkPlan("what this session changed", tuple(sorted(nodes, key=lambda node_plan: node_plan.node_id)))
    ask_before_overwriting(session, path)
    make_file(session, path, plan_as_lines(session, plan, stores))
    shown = join_some(f"node {node.node_id}" for node in plan.nodes)
    counted = plural(plan.writes, "SDO download")
    said = Hint(Action.RUN, {"file": file}, f"{verbatim(file)}: {counted} for {shown}. Run it: {{}}")
    return Facts("save", (("file", file), ("commands", plan.writes)), (said,))


def _stores(lines: list[str]) -> list[str]:
    """Return the parameter groups of stores in *lines*, for `NodePlan`."""
    stores = [line.split()[1:] for line in lines if line.split()[0] == "store"]
    return [next((word for word in words if not word.startswith("-")), "all") for words in stores]


def _planned(node: Node, done: list[str], stores: list[str]) -> NodePlan:
    """Plan from *node* before *done* to its values now, with the last of its *stores*."""
    flat = [line for entry in done for line in entry.splitlines()]
    if unsaid := [line.split()[0] for line in flat if line.startswith(_UNSAID)]:
        raise UsageError(
            f"no gateway line does what `{unsaid[0]}` does",
            node=node.node_id,
            hint=Hint(Action.SAVE_SCRIPT, why="writes a script"),
        )
    plan = Plan(node.node_id, tuple(_ends(node)))
    unstored = ("what the session stored",) if stores else ()  # a store is carried out also where nothing is written
    return NodePlan("", plan, node.identity(), node.title, store=stores[-1] if stores else "", unstored=unstored)


def _ends(node: Node) -> Iterator[Change]:
    """Yield a net change per PDO and object, in the order of their last changes."""
    first: dict[object, Change] = {}
    last: dict[object, Change] = {}
    for change in (change for plan in node.history for change in plan.changes):
        key = change.pdo if isinstance(change, PdoChange) else change.step.object
        first.setdefault(key, change)
        last.pop(key, None)
        last[key] = change
    for place, change in last.items():
        ended = _end(node, first[place], change)
        if alters(ended):
            yield ended


def _end(node: ReadableNode, first: Change, last: Change) -> Change:
    if isinstance(first, PdoChange):
        return plan_pdo(first.pdo, first.before, node.wanted.get(first.pdo) or node.pdo(first.pdo))
    if isinstance(last, ValueChange):
        return ValueChange(replace(last.step, before=first.step.before))
    return last
