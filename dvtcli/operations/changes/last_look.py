"""Whether nodes still hold what was verified of them, after others were changed or have stored. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.bus.turns import one_by_one
from dvtcli.device.change.put_back import first_difference
from dvtcli.errors import BusUnavailable, DeviceRefused, Restarted, SafetyRefusal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.node import Node
    from dvtcli.domain.plan import Change
    from dvtcli.operations.session.session import Session

Changes = Mapping[int, Sequence["Change"]]


def last_look(
    session: Session,
    nodes: Mapping[int, Node],
    changes: Changes,
    boot_ups: Mapping[int, int],
    beside: Callable[[], None] = lambda: None,
) -> list[BaseException]:
    """Faults where one of *nodes* restarted since it had sent *boot_ups*, or does not hold what *changes* made of it.

    A node that restarts does not always say so: each is read back once more. *beside* looks at the others.
    """
    restarted = partial(_refuse_restarted, nodes, boot_ups)
    return (
        one_by_one([restarted])
        or session.bus.side_by_side([partial(refuse_lost, nodes[node_id], some) for node_id, some in changes.items()])
        or one_by_one([beside, restarted])  # once more: what was read of the first ones may be lost by now
    )


@dataclass(frozen=True, slots=True)
class Verified:
    """What *nodes* were verified to hold: *changes*, on the devices of these *identities*.

    *boot_ups* are those that were heard by then, of the nodes that are not to store.
    """

    session: Session
    nodes: Mapping[int, Node]
    changes: Changes
    identities: Mapping[int, Identity]
    boot_ups: Mapping[int, int] = field(default_factory=dict)

    def require(self, node_id: int) -> None:
        """Right before it stores: SafetyRefusal where that is another device, DeviceRefused where it lost something."""
        node = self.nodes[node_id]
        if self.identities.get(node_id, node.identity()) != node.identity():
            raise SafetyRefusal(
                f"node {node_id} is another device than the one that was verified",
                node=node_id,
                hint="attach the one that was changed; `recover --discard` sets the journal of one that is gone aside",
            )
        refuse_lost(node, self.changes.get(node_id, ()))

    def faults(self, proved: Sequence[int]) -> list[BaseException]:
        """Once the stores have ended: what any of the nodes lost; those that were *proved* were read after that."""
        changes = {node_id: some for node_id, some in self.changes.items() if node_id not in proved}
        try:
            now = {one: node.bus.boot_ups(one) for one, node in self.nodes.items() if one in changes}
        except BusUnavailable as failed:
            return [failed]
        return last_look(self.session, self.nodes, changes, {**now, **self.boot_ups})


def refuse_lost(node: Node, changes: Sequence[Change]) -> None:
    """DeviceRefused where *node* does not hold any more what was verified, *changes*, while another one was changed."""
    differences = node.observed(lambda: list(_lost(node, changes)))
    if differences:
        raise DeviceRefused(
            f"node {node.node_id} lost what was set, while the nodes were changed",
            node=node.node_id,
            why="; ".join(differences),
            hint="it may have restarted: look at its supply, then try again",
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
