"""Verify, after the last write and boot-up, that nodes hold all claimed values.

Claimed are written values and those that were equal before. Writes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Protocol

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.roll_back import first_difference
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, DeviceRefused, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dvtcli.device.change.change_group import Storing
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.plan import Change
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.session.session_nodes import SessionNodes

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
            f"node {', '.join(map(str, again))} restarted while the nodes were changed",
            node=again[0],
            hint="check its supply, then try again",
        )
