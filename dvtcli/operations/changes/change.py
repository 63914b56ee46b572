"""Shared by commands that change PDOs: from a request to the last verification and the report of a change."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from dvtcli.device.store.unstored import may_be_unstored
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.consumers import producer_findings, sent_by
from dvtcli.domain.objects import STORE_PARAMETERS
from dvtcli.domain.plan import PdoChange, ValueChange, alters
from dvtcli.domain.process_data import is_standard_command
from dvtcli.domain.script_line import change_lines
from dvtcli.errors import DeviceRefused, DvtcliError

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Applied
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.object_dictionary import OdEntry
    from dvtcli.domain.object_scalings import ScaledValue
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.plan import Change, Plan, Step
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import SessionNodes


def configure(
    session: SessionNodes, node: Node, wants: Mapping[Pdo, AnyPdoRequest], initial_state: InitialState | None = None
) -> Changed:
    """Carry out *wants* on *node*, all or none, and report the changes.

    *initial_state* is the node's initial state if it is claimed already; later reads count.
    """
    started = time.monotonic()
    applied = node.configure(wants, force=session.options.force, initial_state=initial_state)
    more = *_without_producer(session, node, applied), *_other_lengths(session, node, applied)
    applied = applied._replace(findings=(*applied.findings, *more))
    return change_result(session, node, applied, time.monotonic() - started)


def _without_producer(session: SessionNodes, node: NodeDescription, applied: Applied) -> Iterator[Finding]:
    """Warn about enabled RPDOs without a producer, for families that object."""
    changes = [change for change in applied.plan.changes if isinstance(change, PdoChange)]
    if not node.profile.silent_rpdo or all(change.pdo.is_tpdo for change in changes):
        return iter(())
    known = [config for other in session.network.nodes.values() for config in other.tpdos_known()]
    return producer_findings(changes, set(sent_by(known)), node.profile.silent_rpdo)


def _other_lengths(session: SessionNodes, node: NodeDescription, applied: Applied) -> Iterator[Finding]:
    """Warn about linked PDOs of other known nodes whose length differs from a changed PDO."""
    changes = [change for change in applied.plan.changes if isinstance(change, PdoChange)]
    others = (
        [other_node for other_node in session.network.nodes.values() if other_node.node_id != node.node_id]
        if changes
        else []
    )
    if others:
        from dvtcli.domain.network.consumers import changed_length
    for other in others:
        for pdo, held in {**other.last_seen, **other.wanted}.items():
            yield from filter(None, (changed_length(change, other.node_id, pdo, held) for change in changes))


def change_result(
    session: SessionNodes,
    node: Node,
    applied: Applied,
    seconds: float,
    *,
    undone: bool = False,
    lines: list[str] | None = None,
) -> Changed:
    """Make the result of an applied plan; records changes as script *lines* (None: the plan's own)."""
    from dvtcli.operations.results import Changed

    saved = any(node.saves((step.index, step.sub_index)) for step in applied.plan.steps)
    if (saved or any(map(alters, applied.plan.changes))) and not session.dry_run:
        session.record.add(node.node_id, change_lines(applied.plan) if lines is None else lines)
    keep = store_hint(node, applied.plan)
    return Changed(
        node.node_id,
        applied.plan,
        applied.findings,
        session.dry_run,
        seconds,
        undone,
        bool(keep),
        keep,
        mapped_names(node, applied.plan.changes),
        saved=saved and not session.dry_run,
        named=len(session.known_ids()) > 1,
        not_put_back=applied.not_put_back,
        unreadable=applied.unreadable,
        unrestored=applied.unrestored,
        as_before=undone and not (applied.not_put_back or applied.unrestored) and _is_as_stored(node, applied),
        understood=scaled_changes(node, applied.plan.changes),
        remembered=node.guard is None or node.guard.history.remembers_last,
    )


def _is_as_stored(node: Node, applied: Applied) -> bool:
    """Tell whether no store by dvtcli took another value than *applied* rolled back to."""
    return not may_be_unstored(node, node.history, [change.label for change in applied.plan.changes if alters(change)])


def store_hint(node: Node, plan: Plan) -> Hint | str:
    """Say what makes *plan* permanent on *node*: a store, or the maker's way; empty if automatic."""
    policy = node.profile.store
    if not any(policy.needed_for(step.index) for step in plan.steps):
        return ""
    if all(is_standard_command(step.index, _described(node, step)) for step in plan.steps):
        return "a command or a target is not a setting to store"
    if policy.instead:
        return f"to keep it, {policy.instead}"
    dictionary = node.dictionary
    if dictionary is None or not any(dictionary.entry(STORE_PARAMETERS, index) for index in policy.sub_indices):
        stores = takes_store(node)
    else:
        stores = True
    return Hint(Action.STORE, why="keeps it") if stores else "the device has no 0x1010 to store it with"


def _described(node: NodeDescription, step: Step) -> OdEntry | None:
    return node.dictionary.entry(step.index, step.sub_index) if node.dictionary else None


def scaled_changes(node: NodeDescription, changes: Iterable[Change]) -> dict[str, ScaledValue]:
    """Map single objects among *changes* to their scaled values, if a scaling is known."""
    steps = [change.step for change in changes if isinstance(change, ValueChange)]
    if not steps:
        return {}
    from dvtcli.operations.values.object_values import scaled_objects

    return scaled_objects(node, {step.object: len(step.after) for step in steps})


def mapped_names(node: NodeDescription, changes: Iterable[object]) -> dict[str, str]:
    """Map objects mapped by *changes*, as printed, to their names."""
    found: dict[str, str] = {}
    for change in changes:
        if isinstance(change, PdoChange) and node.dictionary is not None:
            for entry in change.after.mapping:
                found[entry.object] = node.dictionary.display_name(entry.index, entry.sub_index)
    return found


def takes_store(node: Node) -> bool:
    """True if *node* supports a store command, or nobody knows; its 0x1010 is read once."""
    if node.takes_store is None:
        from dvtcli.device.store.store_parameters import chosen
        from dvtcli.domain.objects import STORE_PARAMETERS

        try:
            chosen(node.access, node.profile.store, STORE_PARAMETERS, None, node.dictionary)
            node.takes_store = True
        except DeviceRefused:
            node.takes_store = False
        except DvtcliError:
            return True
    return node.takes_store
