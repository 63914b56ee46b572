"""Shared by commands that change PDOs: from a request to the last verification and the report of a change."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Protocol

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.roll_back import first_difference
from dvtcli.device.store.unstored import may_be_unstored
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.consumers import producer_findings, sent_by
from dvtcli.domain.plan import PdoChange, ValueChange, alters
from dvtcli.domain.process_data import is_standard_command
from dvtcli.domain.script_line import change_lines
from dvtcli.domain.text import all_nodes
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Applied
    from dvtcli.device.change.change_group import Storing
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.device.observe import InitialState
    from dvtcli.domain.object_dictionary import OdEntry
    from dvtcli.domain.object_scalings import ScaledValue
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.plan import Change, Plan
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.domain.step import Step
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes

#: "store parameters" (CiA 301, 7.5.2.13)
_STORE = 0x1010


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
        names(node, applied.plan.changes),
        saved=saved and not session.dry_run,
        named=len(session.known_ids()) > 1,
        not_put_back=applied.not_put_back,
        unreadable=applied.unreadable,
        unrestored=applied.unrestored,
        as_before=undone and not (applied.not_put_back or applied.unrestored) and _is_as_stored(node, applied),
        understood=understood(node, applied.plan.changes),
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
    if node.dictionary is None or not any(node.dictionary.entry(_STORE, index) for index in policy.sub_indices):
        stores = takes_store(node)
    else:
        stores = True
    return Hint(Action.STORE, why="keeps it") if stores else "the device has no 0x1010 to store it with"


def _described(node: NodeDescription, step: Step) -> OdEntry | None:
    return node.dictionary.entry(step.index, step.sub_index) if node.dictionary else None


def understood(node: NodeDescription, changes: Iterable[Change]) -> dict[str, ScaledValue]:
    """Map single objects among *changes* to their scaled values, if a scaling is known."""
    steps = [change.step for change in changes if isinstance(change, ValueChange)]
    if not steps:
        return {}
    from dvtcli.operations.values.object_values import understood

    return understood(node, {step.object: len(step.after) for step in steps})


def names(node: NodeDescription, changes: Iterable[object]) -> dict[str, str]:
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
        from dvtcli.device.store.store_parameters import STORE, chosen

        try:
            chosen(node.access, node.profile.store, STORE, None, node.dictionary)
            node.takes_store = True
        except DeviceRefused:
            node.takes_store = False
        except DvtcliError:
            return True
    return node.takes_store


Changes = Mapping[int, Sequence["Change"]]


class OtherExpectations(Protocol):
    """Expected values of a change of several nodes besides its writes, such as equal nodes without writes."""

    def verify(self) -> None:
        """Read all claims; raises Restarted if a node lost them by a restart, DeviceRefused if a value differs."""

    def verify_restarted(self) -> None:
        """Read the claims of nodes that restarted since their last read again; raises as `verify`."""


class NoOtherExpectations:
    """No claims besides the writes."""

    def verify(self) -> None:
        """Do nothing."""

    def verify_restarted(self) -> None:
        """Do nothing."""


def final_verify(
    session: SessionNodes,
    nodes: Mapping[int, ReadableNode],
    changes: Changes,
    boot_ups: Mapping[int, int],
    others: OtherExpectations | None = None,
) -> list[BaseException]:
    """Read all claimed values and return the faults: a restart since *boot_ups*, or another value.

    *changes* are the claims by node-ID. Every node is read, since not every restart sends a boot-up message. *others*
    are read first: a restart without a received boot-up message shows in the written values.
    """
    others = others or NoOtherExpectations()
    require_not_restarted = partial(_require_not_restarted, nodes, boot_ups)
    return (
        one_by_one([require_not_restarted, others.verify])
        or session.bus.side_by_side([partial(require_held, nodes[node_id], some) for node_id, some in changes.items()])
        or one_by_one([others.verify_restarted, require_not_restarted])  # the first nodes may have lost theirs by now
    )


@dataclass(frozen=True, slots=True)
class AlsoExpected:
    """Values expected besides those of the plans, and the *stores* that follow; *proves*: the stores are proved.

    *held* has unchanged values that each node must keep, by node-ID. *equal* are nodes that were as wanted and neither
    change nor store. *others* are claims without a plan.
    """

    held: Mapping[int, Sequence[Change]] = field(default_factory=dict)
    stores: tuple[Storing, ...] = ()
    equal: tuple[Storing, ...] = ()
    proves: bool = False
    others: OtherExpectations = field(default_factory=NoOtherExpectations)


@dataclass(frozen=True, slots=True)
class ExpectedAtStore:
    """The *changes* that each node must hold before the first store and after the last.

    *identities* of the devices and *boot_ups* received from nodes that do not store are by node-ID.
    """

    session: Session
    nodes: Mapping[int, Node]
    changes: Changes
    identities: Mapping[int, Identity]
    boot_ups: Mapping[int, int] = field(default_factory=dict)
    others: OtherExpectations = field(default_factory=NoOtherExpectations)

    def verify_before_store(self, node_id: int) -> None:
        """Raises SafetyRefusal if *node_id* is another device than before, DeviceRefused if it lost values."""
        node = self.nodes[node_id]
        if self.identities.get(node_id, node.identity()) != node.identity():
            raise SafetyRefusal(
                f"node {node_id} is another device than the one that was verified",
                node=node_id,
                hint=Hint(
                    Action.RECOVER,
                    {"discard": True},
                    "attach the one that was changed; {} sets the journal of one that is gone aside",
                ),
            )
        require_held(node, self.changes.get(node_id, ()))

    def verify_after_stores(self) -> list[BaseException]:
        """Return the faults of nodes that lost claimed values by the end of the stores."""
        try:
            now = {node_id: self.nodes[node_id].bus.boot_ups(node_id) for node_id in self.changes}
        except BusUnavailable as failed:
            return [failed]
        return final_verify(self.session, self.nodes, self.changes, {**now, **self.boot_ups})


def require_held(node: ReadableNode, changes: Sequence[Change]) -> None:
    """Raises DeviceRefused if *node*, read again, does not hold the last values of *changes*."""
    differences = node.observed(lambda: list(_lost(node, changes)))
    if differences:
        raise DeviceRefused(
            f"node {node.node_id} does not hold what was planned",
            node=node.node_id,
            why="; ".join(differences),
            hint="it restarted, or altered this beside a change of something else: check its supply and its manual",
        )


def _lost(node: ReadableNode, changes: Sequence[Change]) -> Iterator[str]:
    for change in changes:
        if difference := first_difference(node.sdo, change):
            yield f"{change.label}: {difference}"


def _require_not_restarted(nodes: Mapping[int, ReadableNode], boot_ups: Mapping[int, int]) -> None:
    """Raises Restarted if a node lost verified values while another node was changed."""
    again = [node_id for node_id, seen in boot_ups.items() if nodes[node_id].bus.boot_ups(node_id) != seen]
    if again:
        raise Restarted(
            f"{all_nodes(again)} restarted while the nodes were changed",
            node=again[0],
            hint="check its supply, then try again",
        )
