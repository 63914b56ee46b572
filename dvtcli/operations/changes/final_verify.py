"""The final verification: whether nodes hold all that is claimed of them, after the last write and the last boot-up.

Claimed is what was written, and what was to be so and was equal before. Writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.put_back import first_difference
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, DeviceRefused, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.change.whole import Storing
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Change
    from dvtcli.operations.session.session import Session

Changes = Mapping[int, Sequence["Change"]]


def final_verify(
    session: Session,
    nodes: Mapping[int, Node],
    changes: Changes,
    boot_ups: Mapping[int, int],
    verify_others: Callable[[], None] = lambda: None,
    refuse_restarted: Callable[[], None] = lambda: None,
) -> list[BaseException]:
    """Read everything that is claimed; faults if a node restarted since *boot_ups*, or holds something else.

    *changes* are the claims by node-ID: each node is read, since one that restarts does not always say so.
    *verify_others* reads what is claimed besides; *refuse_restarted* reads it again of who restarted since then.
    """
    restarted = partial(_refuse_restarted, nodes, boot_ups)
    return (
        one_by_one([restarted, verify_others])  # the others first: a restart that is not told shows in what was written
        or session.bus.side_by_side([partial(refuse_lost, nodes[node_id], some) for node_id, some in changes.items()])
        or one_by_one([refuse_restarted, restarted])  # once more: what was read of the first ones may be lost by now
    )


@dataclass(frozen=True, slots=True)
class AlsoClaimed:
    """What is claimed beside the plans that are carried out, and the *stores* that follow; *proves*: with a proof.

    *equal* are the nodes that were as wanted already, and neither are changed nor store. *held* is what each node is to
    hold and held before, by node-ID; *verify_others* reads what is claimed besides,
    as of nodes to which nothing is written, and raises if that is not so; *refuse_restarted* does so of those of them
    that restarted since then.
    """

    held: Mapping[int, Sequence[Change]] = field(default_factory=dict)
    stores: tuple[Storing, ...] = ()
    equal: tuple[Storing, ...] = ()
    proves: bool = False
    verify_others: Callable[[], None] = lambda: None
    refuse_restarted: Callable[[], None] = lambda: None


@dataclass(frozen=True, slots=True)
class Verified:
    """What is claimed of *nodes*: that they hold *changes*, on the devices of these *identities*.

    *boot_ups* are those that were heard by then, of the nodes that are not to store. *verify_others* reads what is
    claimed besides, as of nodes to which nothing is written, and raises if that is not so; *refuse_restarted* reads it
    again of those of them that restarted since then.
    """

    session: Session
    nodes: Mapping[int, Node]
    changes: Changes
    identities: Mapping[int, Identity]
    boot_ups: Mapping[int, int] = field(default_factory=dict)
    verify_others: Callable[[], None] = lambda: None
    refuse_restarted: Callable[[], None] = lambda: None

    def require(self, node_id: int) -> None:
        """Right before it stores: SafetyRefusal where that is another device, DeviceRefused where it lost something."""
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
        refuse_lost(node, self.changes.get(node_id, ()))

    def faults(self) -> list[BaseException]:
        """Once the stores have ended: where a node does not hold any more what is claimed of it."""
        try:
            now = {node_id: self.nodes[node_id].bus.boot_ups(node_id) for node_id in self.changes}
        except BusUnavailable as failed:
            return [failed]
        return final_verify(self.session, self.nodes, self.changes, {**now, **self.boot_ups})


def refuse_lost(node: Node, changes: Sequence[Change]) -> None:
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


def _refuse_restarted(nodes: Mapping[int, Node], boot_ups: Mapping[int, int]) -> None:
    """Restarted where a node has lost what was verified, while another one was changed."""
    again = [node_id for node_id, seen in boot_ups.items() if nodes[node_id].bus.boot_ups(node_id) != seen]
    if again:
        raise Restarted(
            f"node {', '.join(map(str, again))} restarted while the nodes were changed",
            node=again[0],
            hint="look at its supply, then try again",
        )
