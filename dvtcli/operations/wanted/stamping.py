"""The stamps (0x1020) of a network file: which a node is to get, and whom a stamp says to be as the file wants.

Writes nothing. Does not know how a plan is carried out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.stamped import ended_stamp, held_stamp, stamp_changes
from dvtcli.device.unstored import is_remembered
from dvtcli.domain.plan import STAMP, ValueChange
from dvtcli.domain.rules.finding import note
from dvtcli.domain.rules.rule import NOTE, Rule
from dvtcli.domain.stamp import DATE, TIME
from dvtcli.errors import UsageError
from dvtcli.operations.meanings.named_objects import object_at
from dvtcli.operations.wanted.stamped_words import linked_with, wanted_stamp

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dvtcli.device.node import Node
    from dvtcli.domain.network.wanted_state import NetworkWish, NodeWish
    from dvtcli.domain.plan import Change
    from dvtcli.domain.rules import Finding
    from dvtcli.domain.stamp import Stamp

RULES = (
    Rule("stamp-absent", NOTE, "`stamp: true` of a network file, and the node has no 0x1020 that can be written",
         "CiA 301, 0x1020"),
    Rule("stamp-foreign", NOTE, "`stamp: true` of a network file, and 0x1020 of the node is somebody else's",
         "CiA 301, 0x1020"),
)  # fmt: skip

_PLACE = f"0x{STAMP:04X}"
#: Indices that are stored, restored and reset together with 0x1020 (CiA 301, 7.5.2.13).
_COMMUNICATION = range(0x1000, 0x2000)


@dataclass(frozen=True, slots=True)
class Stamping:
    """What a plan does about a node's stamp: the objects that it should hold, how they become so, what to say."""

    values: Mapping[tuple[int, int], bytes]
    changes: tuple[ValueChange, ...] = ()
    findings: tuple[Finding, ...] = ()


def stamps_of(nodes: Mapping[int, Node], wish: NetworkWish) -> dict[int, Stamp]:
    """The stamp of each node of *wish* that is to get one, as the file says it, by node-ID."""
    return {
        node.node_id: wanted_stamp(nodes, wish, node.node_id)
        for node in wish.nodes
        if node.stamp and linked_with(wish, node.node_id) <= nodes.keys()
    }


def stamping(node: Node, wanted: Stamp | None, changes: Sequence[Change]) -> Stamping:
    """What happens to the stamp of *node* where *changes* are made of it; *wanted* None: it is to get none.

    Ours ends with the first change; somebody else's is left alone.
    """
    if wanted is None:
        return Stamping({}, ended_stamp(node, changes))
    held = held_stamp(node)
    if held is None:
        text = "stamp: true means nothing here: it has no 0x1020 that can be written"
        return Stamping({}, findings=(note("stamp-absent", _PLACE, text),))
    if held.is_foreign:
        text = f"0x1020 says {held}, which is not dvtcli's: it is left alone, and the node gets no stamp"
        return Stamping({}, findings=(note("stamp-foreign", _PLACE, text),))
    values = {(STAMP, sub_index): wanted.data(sub_index) for sub_index in (DATE, TIME)}
    due = changes or held != wanted
    return Stamping(values, stamp_changes(held, wanted, f"stamp: {wanted}") if due else ())


def trusted(nodes: Mapping[int, Node], wish: NetworkWish) -> frozenset[int]:
    """The nodes of *wish* whose stamp says that they hold, and have stored, what it says of them.

    Not one of which a change waits to be recovered, or is remembered and not stored; and where links join several,
    all of them or none. Not one either of which the file names objects that go other ways than 0x1020: those kept
    without a store, and all but 0x1000..0x1FFF, which an RPDO may write, and which have a group of their own in 0x1010
    and 0x1011. An old stamp may come back with a restart then, beside a new value.
    """
    stamps = stamps_of(nodes, wish)
    own = {node.node_id for node in wish.nodes if _is_stamped(nodes, node, stamps.get(node.node_id))}
    return frozenset(node_id for node_id in own if linked_with(wish, node_id) <= own)


def _is_stamped(nodes: Mapping[int, Node], wish: NodeWish, wanted: Stamp | None) -> bool:
    if wanted is None:
        return False
    node = nodes[wish.node_id]
    keeper = node.keeper
    if node.unstored or (keeper is not None and (keeper.open_journal() or is_remembered(node, keeper.past))):
        return False
    stored = all(index in _COMMUNICATION and node.profile.store.needed_for(index) for index in _indices(node, wish))
    return stored and held_stamp(node) == wanted


def _indices(node: Node, wish: NodeWish) -> Iterator[int]:
    """The objects that *wish* names besides PDOs, which are communication like 0x1020; 0 for one nobody knows."""
    yield from (pdo.pdo.communication_index for pdo in wish.pdos)
    yield from (object_wish.index for object_wish in wish.objects)
    for word in (value.object for value in wish.values):
        try:
            yield object_at(node, word.text)[0]
        except UsageError:
            yield 0
    if wish.pins:
        yield from (group.index for group in node.profile.vpdo.values())
