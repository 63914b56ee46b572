"""Verify values of a network file that the nodes hold already, so that the plan does not write them. Writes nothing."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.change.changeable import moves
from dvtcli.device.change.roll_back import first_difference
from dvtcli.device.change.untouched_pdos import is_of_pdo
from dvtcli.device.observe import MAX_READS
from dvtcli.device.read_whole import PAUSE_S
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Change, PdoChange, ValueChange, plan_pdo
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged, Restarted, SafetyRefusal
from dvtcli.operations.changes.final_verify import require_held

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.network.network_plan import NodePlan
    from dvtcli.operations.session.session import Session


@dataclass(slots=True)
class UnwrittenValues:
    """The values that *planned* claims for *nodes* without writing them; all were read before."""

    session: Session
    nodes: Mapping[int, Node]
    planned: Sequence[NodePlan]
    _seen: dict[int, int] = field(default_factory=dict)

    def held(self) -> dict[int, tuple[Change, ...]]:
        """Read the file's values on each written node, and before a store all its PDOs.

        Each value is a change to itself. Raises the errors of reading PDOs for nodes that store.
        """
        written = [plan for plan in self.planned if len(plan.plan)]
        stores = [plan.node_id for plan in written if plan.stores and is_of_pdo(plan.plan)]
        self._side_by_side([partial(_read_pdos, self.nodes[node_id]) for node_id in stores])
        return {plan.node_id: _held(self.nodes[plan.node_id], plan, beside=plan.node_id in stores) for plan in written}

    def verify(self) -> None:
        """Verify nodes without writes, and the unwritten settings of the file on the others.

        Raises Restarted if a node restarted and lost what was planned from, DeviceRefused if a value differs.
        """
        equal = self._equal()
        reads = [partial(_refuse_unequal, self.nodes[plan.node_id], plan) for plan in equal if plan.is_read]
        reads += [partial(_refuse_altered, self.nodes[plan.node_id], plan) for plan in self.planned if plan.also_held]
        for _ in range(MAX_READS):
            self.verify_restarted()
            self._side_by_side(reads)
            restarted = [plan.node_id for plan in equal if self._has_restarted(plan)]
            if not restarted:  # what was read of the first ones may be lost by now
                return
        raise _restarts(restarted[0])

    def verify_restarted(self) -> None:
        """Raises Restarted if a node without writes restarted and lost what was planned from."""
        try:
            self.require_as_planned({plan.node_id for plan in self._equal()})
        except SafetyRefusal as lost:
            hint = "check its supply, then try again"
            raise Restarted(lost.text, node=lost.node, place=lost.place, why=lost.why, hint=hint) from lost

    def _equal(self) -> list[NodePlan]:
        """List the plans of nodes without writes, including nodes that store: they are read before the first store."""
        return [plan for plan in self.planned if not len(plan.plan)]

    def require_as_planned(self, of: Collection[int] | None = None) -> None:
        """Raises SafetyRefusal if a node of *of* (None: all) restarted and differs from what it was planned from."""
        for _ in range(MAX_READS):
            restarted = [
                node_plan
                for node_plan in self.planned
                if of is None or node_plan.node_id in of
                if self._has_restarted(node_plan)
            ]
            for plan in restarted:
                node = self.nodes[plan.node_id]
                self._seen[plan.node_id] = node.bus.boot_ups(plan.node_id)
                node.read_anew()
                node.observed(partial(_refuse_unlike, node, plan))
            if not restarted:
                return
        raise _restarts(restarted[0].node_id)

    @contextmanager
    def rolled_back_group(self) -> Iterator[None]:
        """LeftChanged if a device holds another value of a setting without a write after a roll-back."""
        try:
            yield
        except DvtcliError as fault:
            if fault.state == "rolled_back":
                self._refuse_left_altered(fault)
            raise

    def _refuse_left_altered(self, fault: DvtcliError) -> None:
        for planned in (plan for plan in self.planned if plan.also_held):
            node = self.nodes[planned.node_id]
            try:
                altered = node.observed(partial(_altered, node, planned))
            except DvtcliError as unseen:
                what = f"whether node {node.node_id} altered other settings is not known"
                fault.details.append(("also", f"{what}: {unseen.text}"))
                continue
            if altered:
                left = LeftChanged(
                    fault.text,
                    node=node.node_id,
                    why=join_some(altered.values()),
                    state="left_changed",
                    hint=Hint(
                        Action.WRITE,
                        why=f"sets {join_some(altered)} again, if needed: the plan of a file does not",
                    ),
                )
                left.state_text = (
                    f"node {node.node_id} has changed {join_some(altered)}; the planned values are rolled back and "
                    f"verified; nothing was stored"
                )
                raise left from fault

    def _side_by_side(self, reads: Sequence[partial[None]]) -> None:
        for fault in self.session.bus.side_by_side(reads) if reads else ():
            raise fault

    def _has_restarted(self, planned: NodePlan) -> bool:
        now = self.nodes[planned.node_id].bus.boot_ups(planned.node_id)
        first = now if planned.boot_ups is None else planned.boot_ups
        return self._seen.setdefault(planned.node_id, first) != now


def _restarts(node_id: int) -> Restarted:
    return Restarted(f"node {node_id} restarted during each of {MAX_READS} reads", node=node_id)


def _refuse_unequal(node: ReadableNode, planned: NodePlan) -> None:
    """Raises DeviceRefused if *node*, which gets no write, no longer holds the file's values."""
    require_held(node, steady(node, planned.holds))


def _read_pdos(node: ReadableNode) -> None:
    node.known_pdos()


def _held(node: ReadableNode, planned: NodePlan, *, beside: bool) -> tuple[Change, ...]:
    """List what *node* holds and *planned* does not write; with *beside* also PDOs outside the file."""
    own = {change.pdo for change in planned.plan.changes if isinstance(change, PdoChange)}
    said = [change for change in steady(node, planned.holds) if _pdo_of(change) not in own]
    told = {change.pdo for change in said if isinstance(change, PdoChange)}
    others = [
        plan_pdo(pdo, config, config)
        for pdo, config in (node.last_read.items() if beside else ())
        if pdo not in own | told and config.has_cob_id and not config.untold
    ]
    return (*said, *others)


def _pdo_of(change: Change) -> Pdo | None:
    """Return the PDO if *change* writes a single object of a PDO."""
    return Pdo.at(change.step.index) if isinstance(change, ValueChange) else None


def steady(node: ReadableNode, changes: Sequence[Change]) -> list[Change]:
    """Leave out *changes* of objects that the machine changes all the time."""
    return [change for change in changes if _is_steady(node, change)]


def _is_steady(node: ReadableNode, change: Change) -> bool:
    """Tell whether the object of *change* stays constant while the machine runs."""
    return not (isinstance(change, ValueChange) and moves(node, change.step.index, change.step.sub_index))


def _refuse_altered(node: ReadableNode, planned: NodePlan) -> None:
    """Raises DeviceRefused if *node* altered settings of the file that were equal and got no write."""
    altered = node.observed(partial(_altered, node, planned))
    if altered:
        raise DeviceRefused(
            f"node {node.node_id} changed {join_some(altered)} as a side effect of the written values",
            node=node.node_id,
            why=join_some(altered.values()),
            hint="these settings depend on each other in this device: see its manual",
        )


def _altered(node: ReadableNode, planned: NodePlan) -> dict[str, str]:
    """Map altered settings to their difference, except those that change by themselves."""
    differing = {
        change: found
        for change in planned.also_holds
        if _is_steady(node, change) and (found := first_difference(node.sdo, change))
    }
    if differing:
        node.bus.sleep(PAUSE_S)
    return {change.label: found for change, found in differing.items() if first_difference(node.sdo, change) == found}


def refuse_stale(node: ReadableNode, planned: NodePlan, changes: Collection[Change], what: str = "has changed") -> None:
    """Raises SafetyRefusal if *node* is another device than planned or *changes* would replace new values.

    *what* completes the message: what happened to the value.
    """
    if node.identity() != planned.identity:
        raise _stale(node, "is another device than the plan is for")
    look = node.read_cache.look()
    for change in changes:
        difference = first_difference(look, change, wanted_before=True)  # empty when the claim was made
        if difference:
            raise _stale(node, f"{what} since the plan was made: {change.label}", change.label, difference)


def _refuse_unlike(node: ReadableNode, planned: NodePlan) -> None:
    """Raises SafetyRefusal if *node* restarted and differs from *planned*, or was not checked since."""
    if not planned.is_read:
        raise _stale(node, "restarted after its stamp was used instead of a read")
    refuse_stale(node, planned, (*planned.plan.changes, *planned.holds), "restarted, and has changed")


def _stale(node: NodeDescription, what: str, place: str | None = None, why: str | None = None) -> SafetyRefusal:
    hint = Hint(Action.PLAN, {"node": None}, "again, and check the changed values")
    return SafetyRefusal(f"node {node.node_id} {what}", node=node.node_id, place=place, why=why, hint=hint)
