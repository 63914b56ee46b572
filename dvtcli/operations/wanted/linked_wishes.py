"""What the links of a network come to on its nodes: PDOs of both sides, CAN-IDs, heartbeats. Reads, and writes nothing.

Does not know how a wish is planned or carried out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import service_ids
from dvtcli.device.resolve import resolve, untyped_lengths
from dvtcli.domain.network.can_ids import free_can_id, may_keep
from dvtcli.domain.network.links import LinkSide, agrees, linked, object_remarks
from dvtcli.domain.network.wanted_state import (
    Endpoint,
    FileWord,
    LinkWish,
    NetworkWish,
    NodeWish,
    PdoWish,
)
from dvtcli.domain.rules import errors_in
from dvtcli.domain.rules.finding import Finding, error
from dvtcli.domain.rules.rule import ERROR, Rule
from dvtcli.errors import RuleError
from dvtcli.files.network.file_log import FileLog
from dvtcli.operations.wanted.linked_heartbeats import LinkedHeartbeats
from dvtcli.operations.wanted.resolve_names import pdo_request

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.cob_id import CobId

RULES = (
    Rule("link-can-id", ERROR, "both sides of a link are to have CAN-IDs that differ, or none is free",
         "CiA 301, 7.3.5: a PDO has one CAN-ID"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class LinkedWish:
    """A *wish* with what its links come to, and what there is to say of them, by node-ID."""

    wish: NetworkWish
    findings: Mapping[int, tuple[Finding, ...]]


def with_links(nodes: Mapping[int, Node], known: Iterable[Node], wish: NetworkWish) -> LinkedWish:
    """*wish* with the PDOs, CAN-IDs and heartbeats that its links need; *nodes* are those of the wish.

    No CAN-ID is given that a node among *known* uses. Reads them. RuleError with every link that cannot be made.
    """
    linking = _Linking(nodes, [*nodes.values(), *(node for node in known if node.node_id not in nodes)], wish)
    for link in wish.links:
        linking.link(link)
    errors = errors_in(tuple(finding for found in linking.findings.values() for finding in found))
    if errors:
        raise RuleError(f"not linked: {errors[0].text}", errors, can_force=False)
    return LinkedWish(linking.wish(), {node_id: tuple(found) for node_id, found in linking.findings.items()})


@dataclass(slots=True)
class _Linking:
    """The links of *before*, one after the other: what they make of each PDO and node."""

    nodes: Mapping[int, Node]
    known: list[Node]
    before: NetworkWish
    findings: dict[int, dict[Finding, None]] = field(default_factory=dict)
    _pdos: dict[Endpoint, PdoWish] = field(default_factory=dict)
    _heartbeats: LinkedHeartbeats = field(init=False)

    def __post_init__(self) -> None:
        self._heartbeats = LinkedHeartbeats(self.nodes, self.before, self._say)
        for node in self.before.nodes:
            self._pdos |= {Endpoint(node.node_id, pdo.pdo): pdo for pdo in node.pdos}

    def link(self, link: LinkWish) -> None:
        """Take one link in: its findings, and what it makes of both sides."""
        producer = self._side(link.producer)
        cob_id = self._cob_id(link, producer)
        if cob_id is None:
            self._say(link.producer.node_id, error("link-can-id", str(producer), f"no CAN-ID is free for {producer}"))
            return
        self._say(link.producer.node_id, *object_remarks(producer))
        self._set(link.producer, cob_id, None)
        for end in link.consumers:
            self._hear(producer, cob_id, end)
        if link.heartbeat is not False:
            self._heartbeats.watch(link, link.heartbeat)

    def _say(self, node_id: int, *findings: Finding) -> None:
        self.findings.setdefault(node_id, {}).update(dict.fromkeys(findings))

    def _side(self, end: Endpoint) -> LinkSide:
        """A PDO as the wish has it, and as the node holds what that does not say."""
        node = self.nodes[end.node_id]
        config = node.known_pdo(end.pdo)
        wish = self._pdos.get(end)
        if wish is not None:
            want = pdo_request(node, wish, FileLog("", ""))  # words that mean nothing are told where it is planned
            config = resolve(node, end.pdo, config, want, untyped_lengths(node, [want]))
        return LinkSide(end, config, node.profile, node.dictionary)

    def _cob_id(self, link: LinkWish, producer: LinkSide) -> CobId | None:
        """The one that the wish names, or the TPDO has and may keep, else a free one; None where none is."""
        held = producer.config.communication.cob_id
        said = self._pdos.get(link.producer)
        if said is not None and isinstance(said.cob_id, int):
            return held
        used = set(self._used(link, producer))
        if may_keep(held, {can_id for can_id, extended in used if extended == held.extended}):
            return held
        can_id = free_can_id(link.producer, {can_id for can_id, extended in used if not extended})
        return None if can_id is None else replace(held, can_id=can_id, extended=False)

    def _used(self, link: LinkWish, producer: LinkSide) -> Iterator[tuple[int, bool]]:
        """Every CAN-ID, and whether it has 29 bits, that is not free for the producer."""
        for node in self.known:
            yield from service_ids(node.memory, node.node_id, node.dictionary)
            for pdo, cob_id in node.known_cob_ids().items():
                end = Endpoint(node.node_id, pdo)
                wish = self._pdos.get(end)
                if end == link.producer or end in link.consumers or (wish is not None and wish.cob_id is not None):
                    continue
                if cob_id.valid and not self._hears_already(node, end, cob_id, producer):
                    yield cob_id.can_id, cob_id.extended
        for end, wish in self._pdos.items():
            if end != link.producer and end not in link.consumers and isinstance(wish.cob_id, int):
                yield wish.cob_id, wish.extended

    def _hears_already(self, node: Node, end: Endpoint, cob_id: CobId, producer: LinkSide) -> bool:
        """Whether an RPDO hears this producer anyway, or hears it as it is meant once it is on."""
        held = producer.config.communication.cob_id
        if end.pdo.is_tpdo or end.node_id == producer.end.node_id:
            return False
        if (cob_id.can_id, cob_id.extended) != (held.can_id, held.extended):
            return False
        return held.valid or agrees(producer.config.mapping, node.known_pdo(end.pdo).mapping)

    def _hear(self, producer: LinkSide, cob_id: CobId, end: Endpoint) -> None:
        consumer = self._side(end)
        said = self._pdos.get(end)
        if said is not None and isinstance(said.cob_id, int) and said.cob_id != cob_id.can_id:
            text = f"{consumer} is to have CAN-ID 0x{said.cob_id:03X}, and {producer} sends {cob_id}"
            self._say(end.node_id, error("link-can-id", str(consumer), text, hint="leave one of both out"))
            return
        found = linked(producer, consumer)
        stays = found.mapping == consumer.config.mapping
        self._say(end.node_id, *found.findings, *(object_remarks(consumer) if stays else ()))
        mapping = tuple(FileWord(str(entry)) for entry in found.mapping)
        self._set(end, cob_id, None if stays else mapping)

    def _set(self, end: Endpoint, cob_id: CobId, mapping: tuple[FileWord, ...] | None) -> None:
        """The PDO at *end* has this CAN-ID, and this mapping (None: as it is), and is on unless the wish says off."""
        wish = self._pdos.get(end, PdoWish(end.pdo))
        enabled = True if wish.enabled is None else wish.enabled
        mapping = wish.mapping if mapping is None else mapping
        changed = replace(wish, cob_id=cob_id.can_id, extended=cob_id.extended, enabled=enabled, mapping=mapping)
        self._pdos[end] = changed

    def wish(self) -> NetworkWish:
        """The nodes with everything that the links made of them; no links are left."""
        return replace(self.before, nodes=tuple(map(self._node, self.before.nodes)), links=())

    def _node(self, node: NodeWish) -> NodeWish:
        pdos = tuple(self._pdos[end] for end in sorted(self._pdos, key=_order) if end.node_id == node.node_id)
        return self._heartbeats.taken_by(replace(node, pdos=pdos))


def _order(end: Endpoint) -> tuple[bool, Endpoint | object]:
    return not end.pdo.is_tpdo, (end.node_id, end.pdo)
