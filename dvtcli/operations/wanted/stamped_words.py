"""What a network file says of a node, as one text: from it a stamp is made. Reads no device.

Objects that are named stand there as the node's dictionary has them. Does not know where a stamp is kept.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from dvtcli.domain.stamp import Stamp
from dvtcli.errors import UsageError
from dvtcli.operations.meanings.named_objects import entry_at, object_at
from dvtcli.operations.pdos.virtual_pdo_ties import object_index

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.device.node import Node
    from dvtcli.domain.network.wanted_state import FileWord, LinkWish, NetworkWish, NodeWish, PdoWish

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
