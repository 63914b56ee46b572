"""The final verification: whether nodes hold all that is claimed of them, after the last write and the last boot-up.

Claimed is what was written, and what was to be so and was equal before. Writes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Protocol

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.put_back import first_difference
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, DeviceRefused, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dvtcli.device.change.change_group import Storing
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Change
    from dvtcli.operations.session.session import Session

Changes = Mapping[int, Sequence["Change"]]


class OtherClaims(Protocol):
    """What a change of several nodes claims beside what it writes, as of nodes that are equal and not written."""

    def verify(self) -> None:
        """Read all of it; Restarted if a node restarted and lost it, DeviceRefused if it holds something else."""

    def verify_restarted(self) -> None:
        """Read it again of each node that restarted since it was read; errors as `verify`."""


class NoOtherClaims:
    """Nothing is claimed beside what is written."""

    def verify(self) -> None:
        """Do nothing."""

    def verify_restarted(self) -> None:
        """Do nothing."""


def final_verify(
    session: Session,
    nodes: Mapping[int, Node],
    changes: Changes,
    boot_ups: Mapping[int, int],
    others: OtherClaims | None = None,
) -> list[BaseException]:
    """Read everything that is claimed; return the faults: a node restarted since *boot_ups*, or holds another value.

    *changes* are the claims of each node by node-ID. Each node is read, since a node that restarts does not always say
    so. *others* are read first: a restart of which no boot-up message was heard shows in what was written.
    """
    others = others or NoOtherClaims()
    require_not_restarted = partial(_require_not_restarted, nodes, boot_ups)
    return (
        one_by_one([require_not_restarted, others.verify])
        or session.bus.side_by_side([partial(require_held, nodes[node_id], some) for node_id, some in changes.items()])
        or one_by_one([others.verify_restarted, require_not_restarted])  # the first nodes may have lost theirs by now
    )


@dataclass(frozen=True, slots=True)
class AlsoClaimed:
    """What is claimed beside the plans that are carried out, and the *stores* that follow; *proves*: with a proof.

    *held* is what each node is to hold and held before, by node-ID. *equal* are the nodes that were as wanted already:
    they are neither changed nor stored. *others* are the claims that are no plan's.
    """

    held: Mapping[int, Sequence[Change]] = field(default_factory=dict)
    stores: tuple[Storing, ...] = ()
    equal: tuple[Storing, ...] = ()
    proves: bool = False
    others: OtherClaims = field(default_factory=NoOtherClaims)


@dataclass(frozen=True, slots=True)
class ClaimsAtStore:
    """What every node must hold before the first store and after the last one: *changes*, on these devices.

    *identities* are those of the devices, *boot_ups* what was heard by then of the nodes that are not to store, both by
    node-ID.
    """

    session: Session
    nodes: Mapping[int, Node]
    changes: Changes
    identities: Mapping[int, Identity]
    boot_ups: Mapping[int, int] = field(default_factory=dict)
    others: OtherClaims = field(default_factory=NoOtherClaims)

    def verify_before_store(self, node_id: int) -> None:
        """SafetyRefusal if *node_id* is another device than before, DeviceRefused if it lost what it held."""
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
        """Return where a node does not hold any more what is claimed of it, once the stores have ended."""
        try:
            now = {node_id: self.nodes[node_id].bus.boot_ups(node_id) for node_id in self.changes}
        except BusUnavailable as failed:
            return [failed]
        return final_verify(self.session, self.nodes, self.changes, {**now, **self.boot_ups})


def require_held(node: Node, changes: Sequence[Change]) -> None:
    """DeviceRefused if *node* does not hold what *changes* end with, read once more."""
    differences = node.observed(lambda: list(_lost(node, changes)))
    if differences:
        raise DeviceRefused(
            f"node {node.node_id} does not hold what was planned",
            node=node.node_id,
            why="; ".join(differences),
            hint="it restarted, or altered this beside a change of something else: look at its supply and its manual",
        )


def _lost(node: Node, changes: Sequence[Change]) -> Iterator[str]:
    for change in changes:
        if difference := first_difference(node.sdo, change):
            yield f"{change.label}: {difference}"


def _require_not_restarted(nodes: Mapping[int, Node], boot_ups: Mapping[int, int]) -> None:
    """Restarted where a node has lost what was verified, while another one was changed."""
    again = [node_id for node_id, seen in boot_ups.items() if nodes[node_id].bus.boot_ups(node_id) != seen]
    if again:
        raise Restarted(
            f"node {', '.join(map(str, again))} restarted while the nodes were changed",
            node=again[0],
            hint="look at its supply, then try again",
        )
