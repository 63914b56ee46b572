"""The stamps (0x1020) of a network file: which to write, and which nodes match by their stamp.

Writes nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from dvtcli.device.stamped import ended_stamp, held_stamp, stamp_changes
from dvtcli.device.store.unstored import is_remembered
from dvtcli.domain.plan import STAMP, ValueChange
from dvtcli.domain.rules.finding import NOTE, Rule, note
from dvtcli.domain.store import DATE, TIME, Stamp
from dvtcli.errors import UsageError
from dvtcli.operations.values.named_objects import entry_at, object_at, object_index

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription
    from dvtcli.domain.network.network_config import FileWord, LinkConfig, NetworkConfig, NodeConfig, PartialPdoConfig
    from dvtcli.domain.plan import Change
    from dvtcli.domain.rules.finding import Finding

#: changes with the text's form: older stamps are void
_VERSION = "dvtcli stamp 1"


def wanted_stamp(nodes: Mapping[int, Node], config: NetworkConfig, node_id: int) -> Stamp:
    """Compute a node's stamp from its part of *config*, the nodes linked with it, and its identity (0x1018)."""
    joined = linked_with(config, node_id)
    links = [
        [[[end.node_id, str(end.pdo)] for end in link.ends], link.heartbeat]
        for link in config.links
        if link.producer.node_id in joined
    ]
    said = [_words(nodes[node.node_id], node) for node in config.nodes if node.node_id in joined]
    document = [_VERSION, node_id, sorted(nodes[node_id].identity().items()), links, config.multiplier, said]
    return Stamp.of(json.dumps(document))


def linked_with(config: NetworkConfig, node_id: int) -> frozenset[int]:
    """List the nodes that links of *config* join with *node_id*, directly or not, including itself."""
    found = {node_id}
    while more := {end.node_id for link in config.links for end in link.ends if _touches(link, found)} - found:
        found |= more
    return frozenset(found)


def _touches(link: LinkConfig, found: set[int]) -> bool:
    return any(end.node_id in found for end in link.ends)


def _words(node: Node, config: NodeConfig) -> list[Any]:
    return [
        config.node_id,
        bool(config.prune),
        sorted((_pdo_words(node, pdo) for pdo in config.pdos), key=lambda row: str(row[0])),
        sorted(
            [object_config.index, object_config.sub_index, object_config.data.hex()] for object_config in config.objects
        ),
        sorted([_at(object_at, node, value.object), value.value.text] for value in config.values),
        sorted([watch.producer, watch.time_ms] for watch in config.watches),
        sorted([pin.group, pin.pin, pin.object and _at(object_index, node, pin.object)] for pin in config.pins),
    ]


def _pdo_words(node: Node, pdo: PartialPdoConfig) -> list[Any]:
    mapping = None if pdo.mapping is None else [_at(entry_at, node, word) for word in pdo.mapping]
    return [
        str(pdo.pdo), pdo.enabled, pdo.cob_id, pdo.extended, pdo.rtr_allowed, pdo.transmission_type, pdo.inhibit_time,
        pdo.event_timer, pdo.sync_start_value, mapping,
    ]  # fmt: skip


def _at(resolve: Callable[[Node, str], object], node: Node, word: FileWord) -> str:
    """Resolve *word* on *node*; returns *word* if unknown (reported when planned)."""
    try:
        return str(resolve(node, word.text))
    except UsageError:
        return word.text


RULES = (
    Rule("stamp-absent", NOTE, "`stamp: true` of a network file, but the node has no writable 0x1020",
         "CiA 301, 0x1020"),
    Rule("stamp-foreign", NOTE, "`stamp: true` of a network file, but 0x1020 of the node is not a stamp of dvtcli",
         "CiA 301, 0x1020"),
)  # fmt: skip
_PLACE = f"0x{STAMP:04X}"
#: Indices that are stored (0x1010), restored and reset together with the stamp (CiA 301, 7.5.2.13).
_COMMUNICATION = range(0x1000, 0x2000)


class Stamping(NamedTuple):
    """A plan's part about a node's stamp: wanted objects, their changes, findings."""

    values: Mapping[tuple[int, int], bytes]
    changes: tuple[ValueChange, ...] = ()
    findings: tuple[Finding, ...] = ()


def stamps_of(nodes: Mapping[int, Node], config: NetworkConfig) -> dict[int, Stamp]:
    """Map node-IDs of *config* to their wanted stamps."""
    return {
        node.node_id: wanted_stamp(nodes, config, node.node_id)
        for node in config.nodes
        if node.stamp and linked_with(config, node.node_id) <= nodes.keys()
    }


def stamping(node: Node, wanted: Stamp | None, changes: Sequence[Change]) -> Stamping:
    """Plan the stamp of *node* with *changes*; *wanted* None: no stamp.

    Our stamp ends with the first change; a stamp by another tool is left alone.
    """
    if wanted is None:
        return Stamping({}, ended_stamp(node, changes))
    held = held_stamp(node)
    if held is None:
        text = "stamp: true has no effect: the node has no writable 0x1020"
        return Stamping({}, findings=(note("stamp-absent", _PLACE, text),))
    if held.is_foreign:
        text = f"0x1020 is {held}, not a stamp of dvtcli: it is not changed, and the node gets no stamp"
        return Stamping({}, findings=(note("stamp-foreign", _PLACE, text),))
    values = {(STAMP, sub_index): wanted.data(sub_index) for sub_index in (DATE, TIME)}
    due = changes or held != wanted
    return Stamping(values, stamp_changes(held, wanted, f"stamp: {wanted}") if due else ())


def nodes_by_stamp(nodes: Mapping[int, Node], config: NetworkConfig) -> frozenset[int]:
    """List nodes whose stamp proves that they hold and have stored their part of *config*.

    Excluded are nodes with a change to recover or a remembered change not stored. Linked nodes are trusted together or
    not at all. Also excluded are nodes for which the file names objects that are not stored along with 0x1020: objects
    kept without a store, and all outside 0x1000..0x1FFF, which an RPDO may write and which have their own group in
    0x1010 and 0x1011: a restart could restore an old stamp beside a new value.
    """
    stamps = stamps_of(nodes, config)
    own = {node.node_id for node in config.nodes if _is_stamped(nodes, node, stamps.get(node.node_id))}
    return frozenset(node_id for node_id in own if linked_with(config, node_id) <= own)


def _is_stamped(nodes: Mapping[int, Node], config: NodeConfig, wanted: Stamp | None) -> bool:
    if wanted is None:
        return False
    node = nodes[config.node_id]
    guard = node.guard
    if node.unstored or (guard is not None and (guard.unfinished_journal() or is_remembered(node, guard.history))):
        return False
    stored = all(index in _COMMUNICATION and node.profile.store.needed_for(index) for index in _indices(node, config))
    return stored and held_stamp(node) == wanted


def _indices(node: NodeDescription, config: NodeConfig) -> Iterator[int]:
    """Yield the indices of objects that *config* names, a PDO's by its communication record; 0 for unknown names."""
    yield from (pdo.pdo.communication_index for pdo in config.pdos)
    yield from (object_config.index for object_config in config.objects)
    for word in (value.object for value in config.values):
        try:
            yield object_at(node, word.text)[0]
        except UsageError:
            yield 0
    if config.pins:
        yield from (group.index for group in node.profile.vpdo.values())
