"""The stamps (0x1020) of a network file: which a node is to get, and whom a stamp says to be as the file wants.

Writes nothing. Does not know how a plan is carried out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dvtcli.device.stamped import ended_stamp, held_stamp, stamp_changes
from dvtcli.device.unstored import is_remembered
from dvtcli.domain.plan import STAMP, ValueChange
from dvtcli.domain.rules.finding import NOTE, Rule, note
from dvtcli.domain.stamp import DATE, TIME, Stamp
from dvtcli.errors import UsageError
from dvtcli.operations.meanings.named_objects import entry_at, object_at
from dvtcli.operations.pdos.virtual_pdo_ties import object_index

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dvtcli.device.node import Node
    from dvtcli.domain.network.wanted_state import FileWord, LinkWish, NetworkWish, NodeWish, PdoWish
    from dvtcli.domain.plan import Change
    from dvtcli.domain.rules import Finding


#: what changes where the text does: stamps of before count no longer
_VERSION = "dvtcli stamp 1"


def wanted_stamp(nodes: Mapping[int, Node], wish: NetworkWish, node_id: int) -> Stamp:
    """The stamp of what *wish* says of a node, of those that it is linked with, and who the node is (0x1018)."""
    joined = linked_with(wish, node_id)
    links = [
        [[[end.node_id, str(end.pdo)] for end in link.ends], link.heartbeat]
        for link in wish.links
        if link.producer.node_id in joined
    ]
    said = [_words(nodes[node.node_id], node) for node in wish.nodes if node.node_id in joined]
    document = [_VERSION, node_id, sorted(nodes[node_id].identity().items()), links, wish.multiplier, said]
    return Stamp.of(json.dumps(document))


def linked_with(wish: NetworkWish, node_id: int) -> frozenset[int]:
    """The nodes that the links of *wish* join with *node_id*, however far, and itself."""
    found = {node_id}
    while more := {end.node_id for link in wish.links for end in link.ends if _touches(link, found)} - found:
        found |= more
    return frozenset(found)


def _touches(link: LinkWish, found: set[int]) -> bool:
    return any(end.node_id in found for end in link.ends)


def _words(node: Node, wish: NodeWish) -> list[Any]:
    return [
        wish.node_id,
        bool(wish.prune),
        sorted((_pdo_words(node, pdo) for pdo in wish.pdos), key=lambda row: str(row[0])),
        sorted([object_wish.index, object_wish.sub_index, object_wish.data.hex()] for object_wish in wish.objects),
        sorted([_at(object_at, node, value.object), value.value.text] for value in wish.values),
        sorted([watch.producer, watch.time_ms] for watch in wish.watches),
        sorted([pin.group, pin.pin, pin.object and _at(object_index, node, pin.object)] for pin in wish.pins),
    ]


def _pdo_words(node: Node, pdo: PdoWish) -> list[Any]:
    mapping = None if pdo.mapping is None else [_at(entry_at, node, word) for word in pdo.mapping]
    return [
        str(pdo.pdo), pdo.enabled, pdo.cob_id, pdo.extended, pdo.rtr_allowed, pdo.transmission_type, pdo.inhibit_time,
        pdo.event_timer, pdo.sync_start_value, mapping,
    ]  # fmt: skip


def _at(resolve: Callable[[Node, str], object], node: Node, word: FileWord) -> str:
    """What *word* means there; itself where that is nothing, which is told where it is planned."""
    try:
        return str(resolve(node, word.text))
    except UsageError:
        return word.text


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
