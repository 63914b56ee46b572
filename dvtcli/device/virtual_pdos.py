"""Read and change the virtual PDOs of one node; `domain.vpdo` has their rules."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from dvtcli.device.change.applied import Applied, refuse
from dvtcli.device.read_pdos import read_optional
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.plan import Plan, ValueChange
from dvtcli.domain.vpdo import Pins
from dvtcli.errors import DvtcliError, UsageError

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.profile import VpdoGroup
    from dvtcli.domain.rules import Finding

#: The highest sub-index that an object can have for an entry of its own (CiA 301, 7.4.8).
_MOST_PINS = 0xFE


def group_names(node: NodeDescription) -> list[str]:
    """The groups of virtual PDOs of the node's family. Raises DvtcliError if it has none."""
    if node.profile.vpdo:
        return list(node.profile.vpdo)
    raise DvtcliError(
        f"node {node.node_id} ({node.profile.title}) has no virtual PDOs",
        node=node.node_id,
        hint=Hint(Action.SHOW_NODE, {"node": node.node_id}, "tells its profile")
        + Hint(Action.GIVE_PROFILE, why="uses another profile if it is wrong"),
    )


def read_pins(node: ReadableNode, name: str) -> Pins:
    """The present pins of the group called *name*. Raises UsageError if the node has no such group."""
    if name not in group_names(node):
        have = ", ".join(node.profile.vpdo)
        raise UsageError(f"node {node.node_id} has no virtual PDOs called {name!r}; it has {have}", node=node.node_id)
    group = node.profile.vpdo[name]
    active = int.from_bytes(node.upload(group.index, 0), "little")
    values = tuple(_values(node, group))
    return Pins(name, group, min(active, len(values)), values)


def _values(node: ReadableNode, group: VpdoGroup) -> Iterable[int]:
    """The value of each pin; the number of sub-indices is the device's number of pins of the kind."""
    for pin in range(1, _MOST_PINS + 1):
        held = read_optional(node.sdo, group.index, pin, 2)
        if held is None:
            return
        yield held


def tie_findings(node: NodeDescription, index: int, sub_index: int, data: bytes) -> Iterator[Finding]:
    """Findings against *data* at *index*:*sub_index* if the object is a pin of virtual PDOs."""
    for name, group in node.profile.vpdo.items():
        if group.index == index and sub_index and len(data) == 2:
            yield from Pins(name, group, 0, ()).findings(sub_index, int.from_bytes(data, "little"), node.dictionary)


def names_objects(node: NodeDescription, index: int, sub_index: int) -> bool:
    """True if a value at *index*:*sub_index* is the index of another object, as for a pin."""
    return bool(sub_index) and any(group.index == index for group in node.profile.vpdo.values())


def apply(node: Node, changes: Iterable[ValueChange], findings: Iterable[Finding], *, force: bool) -> Applied:
    """Apply *changes* of virtual PDOs, all or none, unless *findings* forbid them without *force*."""
    found = tuple(findings)
    refuse(found, "virtual PDOs not changed", node.node_id, force=force)
    return node.apply(Plan(node.node_id, tuple(changes)), found, force=force)
