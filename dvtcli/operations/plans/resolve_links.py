"""Resolve the links of a network into PDOs of both sides, CAN-IDs and heartbeats. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.device.proposal import resolve, untyped_lengths
from dvtcli.device.read_pdos import service_ids
from dvtcli.device.seen_state import heartbeat_ms, heartbeat_slots, is_guarded
from dvtcli.domain.cob_id import can_id_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.links import (
    CONSUMER_PERIODS,
    LinkSide,
    agrees,
    free_can_id,
    linked,
    may_keep,
    object_remarks,
    slot_for,
    watch_time_ms,
    watched_ms,
)
from dvtcli.domain.network.network_config import (
    Endpoint,
    FileWord,
    HeartbeatWatch,
    LinkConfig,
    Mark,
    NetworkConfig,
    NodeConfig,
    ObjectConfig,
    PartialPdoConfig,
    ValueConfig,
)
from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.objects import CONSUMER_HEARTBEAT, PRODUCER_HEARTBEAT
from dvtcli.domain.rules import errors_in
from dvtcli.domain.rules.finding import ERROR, WARNING, Finding, Rule, error, note, warning
from dvtcli.errors import RuleError
from dvtcli.files.network.file_log import FileLog
from dvtcli.operations.plans.resolve_names import pdo_request

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.cob_id import CobId

_HEARTBEAT = "heartbeat_producer"


@dataclass(slots=True)
class LinkedHeartbeats:
    """The heartbeats for links between *nodes*, in addition to those in *before*; *report* takes findings."""

    nodes: Mapping[int, Node]
    before: NetworkConfig
    report: Callable[[int, Finding], None]
    _producers: dict[int, list[ObjectConfig]] = field(default_factory=dict)
    _watches: dict[int, dict[int, HeartbeatWatch]] = field(default_factory=dict)
    _slots: dict[int, dict[int, int]] = field(default_factory=dict)

    def watch(self, link: LinkConfig, asked_ms: int | None) -> None:
        """Let the consumers expect the producer's heartbeat; *asked_ms* sets its producer time in ms."""
        node_id = link.producer.node_id
        time_ms = self._period_ms(node_id, asked_ms, link.mark)
        if not time_ms:
            text = f"node {node_id} sends no heartbeat: its loss would go unnoticed"
            self.report(node_id, note("link-silent", f"node {node_id}", text))
            return
        for consumer in dict.fromkeys(end.node_id for end in link.consumers):
            self._watch_one(consumer, HeartbeatWatch(node_id, time_ms, link.mark))

    def _period_ms(self, node_id: int, asked_ms: int | None, mark: Mark) -> int:
        """How often the producer will send a heartbeat, in ms; 0 for never."""
        node = self.nodes[node_id]
        if asked_ms is None:
            said = [*self._producers.get(node_id, ()), *_node(self.before, node_id).objects]
            return _configured_ms(said, heartbeat_ms(node.read_cache) or 0)
        place = f"node {node_id}"
        if heartbeat_ms(node.read_cache) is None:
            text = f"node {node_id} has no 0x1017: it cannot send a heartbeat"
            self.report(
                node_id,
                error(
                    "link-no-heartbeat", place, text, hint=Hint(Action.GIVE, {"heartbeat": False}, "leaves it alone")
                ),
            )
        elif is_guarded(node.read_cache):
            text = f"node {node_id} is guarded (0x100C and 0x100D are not 0), which excludes a heartbeat"
            self.report(
                node_id,
                error("link-guarded", place, text, hint=Hint(Action.GIVE, {"heartbeat": False}, "leaves it alone")),
            )
        config = ObjectConfig(_HEARTBEAT, PRODUCER_HEARTBEAT, 0, asked_ms.to_bytes(2, "little"), mark)
        self._producers.setdefault(node_id, []).append(config)
        return asked_ms

    def _watch_one(self, consumer: int, heartbeat: HeartbeatWatch) -> None:
        """Let node *consumer* expect *heartbeat* with a longer time than its producer's."""
        producer, time_ms = heartbeat.producer, heartbeat.time_ms
        if any(watch.producer == producer for watch in _node(self.before, consumer).watches):
            return  # somebody said how long
        if consumer not in self._slots:
            held = heartbeat_slots(self.nodes[consumer].read_cache)
            said = _configured_slots(_node(self.before, consumer).values)
            self._slots[consumer] = held | {sub: value for sub, value in said.items() if sub in held}
        slots = self._slots[consumer]
        if watched_ms(slots, producer) > time_ms:
            return
        multiplier = CONSUMER_PERIODS if self.before.multiplier is None else self.before.multiplier
        late_ms, sub_index = watch_time_ms(time_ms, multiplier), slot_for(slots, producer)
        if late_ms is None or sub_index is None:
            text = f"node {consumer} does not monitor node {producer}: {_why_not(slots, sub_index, time_ms)}"
            self.report(consumer, warning("link-unwatched", f"node {consumer}", text))
            return
        slots[sub_index] = producer << 16 | late_ms
        self._watches.setdefault(consumer, {})[producer] = replace(heartbeat, time_ms=late_ms)

    def taken_by(self, node: NodeConfig) -> NodeConfig:
        """Return *node* with its heartbeat producer and consumer times."""
        objects = (*node.objects, *self._producers.get(node.node_id, ()))
        watches = (*node.watches, *self._watches.get(node.node_id, {}).values())
        return replace(node, objects=objects, watches=watches)


def _why_not(slots: Mapping[int, int], sub_index: int | None, time_ms: int) -> str:
    if not slots:
        return "it has no 0x1016"
    return "0x1016 has no free entry" if sub_index is None else f"0x1016 accepts no time longer than {time_ms} ms"


def _node(config: NetworkConfig, node_id: int) -> NodeConfig:
    return next(node for node in config.nodes if node.node_id == node_id)


def _configured_slots(values: Iterable[ValueConfig]) -> dict[int, int]:
    """Map entries of 0x1016 that *values* name by number; invalid numbers are reported elsewhere."""
    found: dict[int, int] = {}
    for value in values:
        place = parse_object(value.object.text)
        if place is not None and place[0] == CONSUMER_HEARTBEAT:
            with suppress(ValueError):
                found[place[1]] = int(value.value.text, 0)
    return found


def _configured_ms(said: Iterable[ObjectConfig], held_ms: int) -> int:
    """Return the wanted 0x1017 in ms, else the node's value."""
    return next((int.from_bytes(config.data, "little") for config in said if config.key == _HEARTBEAT), held_ms)


RULES = (
    Rule("link-can-id", ERROR, "the two sides of a link were given different CAN-IDs, or no CAN-ID is free",
         "CiA 301, 7.3.5: a PDO has one CAN-ID"),
    Rule("link-off", WARNING, "a network file disables an RPDO that it links to a TPDO", "CiA 301, 7.5.2.35: bit 31"),
    Rule("link-no-sync", WARNING, "`link`: the TPDO is synchronous, and no known node produces SYNC",
         "CiA 301, 7.5.2.37: transmission type"),
)  # fmt: skip


class LinkedConfig(NamedTuple):
    """A *config* with its links resolved, and findings by node-ID."""

    config: NetworkConfig
    findings: Mapping[int, tuple[Finding, ...]]


def with_links(nodes: Mapping[int, Node], known: Iterable[Node], config: NetworkConfig) -> LinkedConfig:
    """Resolve the links of *config* into PDOs, CAN-IDs and heartbeats; *nodes* are those of *config*.

    A new CAN-ID is free on all *known* nodes, which are read. Raises RuleError with every link that cannot be made.
    """
    linking = _Linking(nodes, [*nodes.values(), *(node for node in known if node.node_id not in nodes)], config)
    for link in config.links:
        linking.link(link)
    errors = errors_in(tuple(finding for found in linking.findings.values() for finding in found))
    if errors:
        raise RuleError(f"not linked: {errors[0].text}", errors, can_force=False)
    return LinkedConfig(linking.config(), {node_id: tuple(found) for node_id, found in linking.findings.items()})


@dataclass(slots=True)
class _Linking:
    """The links of *before*, resolved one after another."""

    nodes: Mapping[int, Node]
    known: list[Node]
    before: NetworkConfig
    findings: dict[int, dict[Finding, None]] = field(default_factory=dict)
    _pdos: dict[Endpoint, PartialPdoConfig] = field(default_factory=dict)
    _heartbeats: LinkedHeartbeats = field(init=False)

    def __post_init__(self) -> None:
        self._heartbeats = LinkedHeartbeats(self.nodes, self.before, self._report)
        for node in self.before.nodes:
            self._pdos |= {Endpoint(node.node_id, pdo.pdo): pdo for pdo in node.pdos}

    def link(self, link: LinkConfig) -> None:
        """Resolve a link: its findings, and the changes of both sides."""
        producer = self._side(link.producer)
        cob_id = self._cob_id(link, producer)
        if cob_id is None:
            self._report(
                link.producer.node_id, error("link-can-id", str(producer), f"no CAN-ID is free for {producer}")
            )
            return
        self._report(link.producer.node_id, *object_remarks(producer))
        self._set(link.producer, cob_id, None)
        for end in link.consumers:
            self._hear(producer, cob_id, end)
        if link.heartbeat is not False:
            self._heartbeats.watch(link, link.heartbeat)

    def _report(self, node_id: int, *findings: Finding) -> None:
        self.findings.setdefault(node_id, {}).update(dict.fromkeys(findings))

    def _side(self, end: Endpoint) -> LinkSide:
        """Return a PDO as wanted, completed with the node's values."""
        node = self.nodes[end.node_id]
        config = node.known_pdo(end.pdo)
        requested = self._pdos.get(end)
        if requested is not None:
            want = pdo_request(node, requested, FileLog("", ""))  # words that mean nothing are told where it is planned
            config = resolve(node, end.pdo, config, want, untyped_lengths(node, [want]))
        return LinkSide(end, config, node.profile, node.dictionary)

    def _cob_id(self, link: LinkConfig, producer: LinkSide) -> CobId | None:
        """Return the wanted COB-ID, the TPDO's own if it may stay, else a free COB-ID; None if none is free."""
        held = producer.config.communication.cob_id
        said = self._pdos.get(link.producer)
        if (said is not None and isinstance(said.cob_id, int)) or self._is_given(link.consumers, held):
            return held  # the rules tell what else sends it
        used = set(self._used(link, producer))
        if may_keep(held, {can_id for can_id, extended in used if extended == held.extended}):
            return held
        can_id = free_can_id(link.producer, {can_id for can_id, extended in used if not extended})
        return None if can_id is None else replace(held, can_id=can_id, extended=False)

    def _is_given(self, consumers: Iterable[Endpoint], cob_id: CobId) -> bool:
        """Tell whether the file gives one of *consumers* the CAN-ID of *cob_id*."""
        given = (pdo for end in consumers for pdo in _node(self.before, end.node_id).pdos if pdo.pdo == end.pdo)
        return any((pdo.cob_id, pdo.extended) == (cob_id.can_id, cob_id.extended) for pdo in given)

    def _used(self, link: LinkConfig, producer: LinkSide) -> Iterator[tuple[int, bool]]:
        """Yield every used CAN-ID, and whether it is a 29-bit identifier."""
        for node in self.known:
            yield from service_ids(node.read_cache, node.node_id, node.dictionary)
            for pdo, cob_id in node.known_cob_ids().items():
                end = Endpoint(node.node_id, pdo)
                config = self._pdos.get(end)
                if end == link.producer or end in link.consumers or (config is not None and config.cob_id is not None):
                    continue
                if cob_id.valid and not self._hears_already(node, end, cob_id, producer):
                    yield cob_id.can_id, cob_id.extended
        for end, config in self._pdos.items():
            if end != link.producer and end not in link.consumers and isinstance(config.cob_id, int):
                yield config.cob_id, config.extended

    def _hears_already(self, node: ReadableNode, end: Endpoint, cob_id: CobId, producer: LinkSide) -> bool:
        """Tell whether an RPDO already receives this producer, or will once it is enabled."""
        held = producer.config.communication.cob_id
        if end.pdo.is_tpdo or end.node_id == producer.end.node_id:
            return False
        if (cob_id.can_id, cob_id.extended) != (held.can_id, held.extended):
            return False
        return held.valid or agrees(producer.config.mapping, node.known_pdo(end.pdo).mapping)

    def _hear(self, producer: LinkSide, cob_id: CobId, end: Endpoint) -> None:
        consumer = self._side(end)
        said = self._pdos.get(end)
        if (
            said is not None
            and isinstance(said.cob_id, int)
            and (said.cob_id, said.extended)
            != (
                cob_id.can_id,
                cob_id.extended,
            )
        ):
            wanted = can_id_text(said.cob_id, extended=said.extended)
            text = f"{consumer} is to have CAN-ID {wanted}, and {producer} sends {cob_id}"
            self._report(end.node_id, error("link-can-id", str(consumer), text, hint=_without_can_id(said, consumer)))
            return
        if said is not None and said.enabled is False:
            text = f"{consumer} is linked to {producer}, but the file disables it: it receives nothing"
            hint = f"remove enabled: false of {consumer}, or the link"
            self._report(end.node_id, warning("link-off", str(consumer), text, hint))
        found = linked(producer, consumer)
        stays = found.mapping == consumer.config.mapping
        self._report(end.node_id, *found.findings, *(object_remarks(consumer) if stays else ()))
        mapping = tuple(FileWord(str(entry)) for entry in found.mapping)
        self._set(end, cob_id, None if stays else mapping)

    def _set(self, end: Endpoint, cob_id: CobId, mapping: tuple[FileWord, ...] | None) -> None:
        """Set CAN-ID and mapping (None: unchanged) of the PDO at *end*; it is enabled unless disabled."""
        config = self._pdos.get(end, PartialPdoConfig(end.pdo))
        enabled = True if config.enabled is None else config.enabled
        mapping = config.mapping if mapping is None else mapping
        changed = replace(config, cob_id=cob_id.can_id, extended=cob_id.extended, enabled=enabled, mapping=mapping)
        self._pdos[end] = changed

    def config(self) -> NetworkConfig:
        """Return all nodes with the changes by links, without links."""
        return replace(self.before, nodes=tuple(map(self._node, self.before.nodes)), links=())

    def _node(self, node: NodeConfig) -> NodeConfig:
        pdos = tuple(self._pdos[end] for end in sorted(self._pdos, key=_order) if end.node_id == node.node_id)
        return self._heartbeats.taken_by(replace(node, pdos=pdos))


def _without_can_id(said: PartialPdoConfig, consumer: LinkSide) -> str:
    """What to remove from the file's RPDO *said*, so that a link gives it the CAN-ID."""
    mark = said.keys.get(1)
    line = f" (line {mark.line})" if mark is not None and mark.line else ""
    off = " and enabled: false" if said.enabled is False else ""
    return f"remove cob_id:{line}{off} of {consumer}: the link gives it the CAN-ID of its TPDO"


def _order(end: Endpoint) -> tuple[bool, Endpoint | object]:
    return not end.pdo.is_tpdo, (end.node_id, end.pdo)
