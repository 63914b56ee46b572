"""Who else sends a CAN-ID: the other nodes of a session or of a plan, and unknown nodes on the bus."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import (
    UNREADABLE,
    read_cob_id,
    read_side_by_side,
    sdo_channels,
    service_ids,
    service_ids_beside,
)
from dvtcli.domain.cob_id import CobId, taken_by_channels
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.consumers import by_id
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.rules.can_id import is_of_service
from dvtcli.domain.rules.finding import Producer, error
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.network.consumers import Id
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.ports import CanopenBus, Frame, SdoReader
    from dvtcli.domain.rules.finding import Finding


def producers(nodes: Iterable[KnownPdos], *, anew: bool = True) -> tuple[Producer, ...]:
    """Every enabled TPDO of *nodes*, read now; the last known values of a node without an answer.

    Without *anew* from the cache if nothing could have changed since.
    """
    return tuple(producer for node in nodes for producer in _producers(node, anew=anew))


def channels_taken(nodes: Iterable[ReadableNode]) -> dict[tuple[int, bool], str]:
    """CAN-IDs of further SDO channels of *nodes*, each with a description; none for a silent node.

    A node without an EDS and without any read so far is not asked.
    """
    found: dict[tuple[int, bool], str] = {}
    for node in nodes:
        if node.dictionary is not None or node.last_seen:
            with suppress(NoAnswer, SdoProtocolError):
                found |= taken_by_channels(node.node_id, sdo_channels(node.read_cache.look(), node.dictionary))
    return found


def services_taken(nodes: Iterable[ReadableNode], *, without: int | None = None) -> dict[tuple[int, bool], str]:
    """CAN-IDs of SYNC, EMCY, TIME and further SDO channels of *nodes* (see `channels_taken`), except *without*."""
    found: dict[tuple[int, bool], str] = {}
    for node in nodes:
        if node.dictionary is not None or node.last_seen:
            with suppress(NoAnswer, SdoProtocolError):
                found |= service_ids_beside(node.read_cache.look(), node.node_id, node.dictionary, without=without)
    return found


def enabled_pdos(nodes: Iterable[ReadableNode]) -> Iterator[Producer]:
    """Every enabled PDO of *nodes*, including RPDOs; the last known values of a node without an answer."""
    for node in nodes:
        try:
            held = dict(node.known_cob_ids())
        except (NoAnswer, SdoAborted, SdoProtocolError):
            held = {pdo: config.communication.cob_id for pdo, config in {**node.last_read, **node.wanted}.items()}
        yield from (Producer(node.node_id, pdo, cob_id) for pdo, cob_id in held.items() if cob_id.valid)


def producers_of(nodes: Iterable[KnownPdos], cob_id: CobId) -> tuple[Producer, ...]:
    """The enabled TPDOs of *nodes* with the CAN-ID of *cob_id*, read now.

    Reads a node if it was known to send the CAN-ID, or if some of its TPDOs are unknown since its boot-up.
    """
    asked = [node for node in nodes if any(map(partial(_same_id, cob_id), _ever_known(node))) or not _is_known(node)]
    return tuple(producer for producer in producers(asked) if _same_id(cob_id, producer.cob_id))


def _is_known(node: KnownPdos) -> bool:
    return node.sent is not None and node.sent[0] == node.bus.boot_ups(node.node_id)


def _ever_known(node: KnownPdos) -> Iterator[CobId]:
    """All known COB-IDs of the TPDOs of *node*, read or set by this session."""
    yield from () if node.sent is None else node.sent[1].values()
    for known in (node.last_seen, node.wanted):
        yield from (config.communication.cob_id for pdo, config in known.items() if pdo.is_tpdo)


def _same_id(one: CobId, other: CobId) -> bool:
    return (one.can_id, one.extended) == (other.can_id, other.extended)


def _producers(node: KnownPdos, *, anew: bool) -> Iterator[Producer]:
    for pdo, cob_id in _cob_ids(node, node.sdo if anew else node.read_cache.look()).items():
        if cob_id.valid:
            yield Producer(node.node_id, pdo, cob_id)


def _cob_ids(node: KnownPdos, sdo: SdoReader) -> dict[Pdo, CobId]:
    """The COB-IDs of the TPDOs of *node*, read through *sdo*: another dvtcli may have changed them."""
    known = {pdo: config.communication.cob_id for pdo, config in {**node.last_read, **node.wanted}.items()}
    boot_ups = node.bus.boot_ups(node.node_id)
    try:
        present = [pdo for pdo in node.present() if pdo.is_tpdo]
        held = {}
        for pdo in present:
            with suppress(SdoAborted):  # refused for the moment: what the node sends stays incomplete
                held[pdo] = _cob_id(node, sdo, pdo, known)
        if len(held) == len(present):
            node.sent = boot_ups, {pdo: cob_id for pdo, cob_id in held.items() if cob_id is not None}
    except (NoAnswer, SdoAborted, SdoProtocolError):  # a node that is off or STOPPED does not block changes of others
        held = {pdo: cob_id for pdo, cob_id in known.items() if pdo.is_tpdo}
    return {pdo: cob_id for pdo, cob_id in held.items() if cob_id is not None}


def _cob_id(node: ReadableNode, sdo: SdoReader, pdo: Pdo, known: Mapping[Pdo, CobId]) -> CobId | None:
    """Sub-index 1 of a TPDO; the *known* COB-ID if unreadable, or None for a missing TPDO.

    A refusal that may pass is not believed: it may be an old one of the cache, so the node is asked once more. Raises
    SdoAborted if it refuses that for the moment, too, and no COB-ID is known.
    """
    try:
        return read_cob_id(sdo, pdo)
    except SdoAborted as aborted:
        if aborted.code in UNREADABLE:
            return known.get(pdo)
    node.read_cache.forget_one(pdo.communication_index, 1)
    try:
        return read_cob_id(node.read_cache.look(), pdo)
    except SdoAborted as aborted:
        if pdo not in known and aborted.code not in UNREADABLE:
            raise
        return known.get(pdo)


@dataclass(slots=True, eq=False, repr=False)
class Senders:
    """The TPDOs of *nodes*, as read for this plan, and their COB-IDs after the plan or by a file.

    *after* has the new COB-ID of each changed TPDO, by node-ID; None if it will be disabled, or its COB-ID is unknown
    yet.
    """

    nodes: Mapping[int, KnownPdos]
    after: dict[int, dict[Pdo, CobId | None]] = field(default_factory=dict)
    _now: dict[int, tuple[Producer, ...]] = field(default_factory=dict)
    _sent: Mapping[Id, Sequence[Producer]] | None = None
    _received: Mapping[Id, Sequence[Producer]] | None = None
    _channels: Mapping[tuple[int, bool], str] | None = None

    def read_ahead(self, changed: Collection[int]) -> None:
        """Read the TPDOs of all nodes, and the services of *changed* nodes, in parallel.

        A read error of a service is reported at its first use; of a node that does not answer the known TPDOs count.
        """
        nodes = self.nodes.values()
        read_side_by_side(nodes, [partial(self._read_ahead, node, services=node.node_id in changed) for node in nodes])

    def _read_ahead(self, node: KnownPdos, *, services: bool) -> None:
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):
            sdo_channels(node.read_cache.look(), node.dictionary)
            if services:
                service_ids(node.read_cache.look(), node.node_id, node.dictionary)
        tuple(self._of(node))

    def besides(self, node_id: int) -> tuple[Producer, ...]:
        """The future TPDOs of the other nodes, and present TPDOs of known nodes outside the plan."""
        return tuple(
            producer
            for other in (*self.nodes.values(), *self._strangers())
            if other.node_id != node_id
            for producer in self._of(other)
        )

    def besides_with(self, node_id: int, cob_id: CobId) -> Sequence[Producer]:
        """The producers in `besides` with the CAN-ID of *cob_id*; fixed like `sent`."""
        same = self.sent().get((cob_id.can_id, cob_id.extended), ())
        return [producer for producer in same if producer.node_id != node_id]

    def sent(self) -> Mapping[Id, Sequence[Producer]]:
        """The future TPDOs of all nodes by CAN-ID; fixed from the first call on."""
        if self._sent is None:
            nodes = (*self.nodes.values(), *self._strangers())
            self._sent = by_id(producer for node in nodes for producer in self._of(node))
        return self._sent

    def received(self) -> Mapping[Id, Sequence[Producer]]:
        """Every enabled future RPDO of answering nodes by CAN-ID; fixed like `sent`."""
        if self._received is None:
            self._received = by_id(self._rpdos())
        return self._received

    def channels(self) -> Mapping[tuple[int, bool], str]:
        """The CAN-IDs of further SDO channels of all nodes, each with a description; fixed like `sent`.

        Includes all services of nodes outside the plan; services of its nodes may be changed by the plan.
        """
        if self._channels is None:
            self._channels = {**services_taken(self._strangers()), **channels_taken(self.nodes.values())}
        return self._channels

    def _rpdos(self) -> Iterator[Producer]:
        for node in (*self.nodes.values(), *self._strangers()):
            after = self.after.get(node.node_id, {})
            try:
                held = node.known_cob_ids()
            except (NoAnswer, SdoAborted, SdoProtocolError):
                continue  # a node that is off does not block changes of others
            for pdo, cob_id in {**held, **after}.items():
                if cob_id is not None and cob_id.valid and not pdo.is_tpdo:
                    yield Producer(node.node_id, pdo, cob_id)

    def _strangers(self) -> Iterator[KnownPdos]:
        first = next(iter(self.nodes.values()), None)
        for other in first.neighbours() if first is not None else ():
            if other.node_id not in self.nodes:
                yield other

    def _of(self, node: KnownPdos) -> Iterator[Producer]:
        if node.node_id not in self._now:
            self._now[node.node_id] = producers([node], anew=node.node_id not in self.nodes)
        after = self.after.get(node.node_id, {})
        yield from (producer for producer in self._now[node.node_id] if producer.pdo not in after)
        for pdo, cob_id in after.items():
            if cob_id is not None and cob_id.valid and pdo.is_tpdo:
                yield Producer(node.node_id, pdo, cob_id)


#: how long is listened for a CAN-ID in all, the time in which the node is read included (s), and at once
LISTENED_S, AT_ONCE_S = 0.1, 0.01


@dataclass(slots=True, eq=False, repr=False)
class ReceivedIds:
    """Counts of received frames per CAN-ID (with true for 29 bits), and the CAN-IDs sent from here.

    *bus* is monitored since *since_s* (s, in its time) with the *states* of its nodes at that time; None if not
    monitored.
    """

    bus: CanopenBus | None = None
    since_s: float = 0.0
    states: Mapping[int, NmtState] = field(default_factory=dict)
    others: dict[tuple[int, bool], int] = field(default_factory=dict)
    sent: set[tuple[int, bool]] = field(default_factory=set)

    def note(self, frame: Frame, sent: bool) -> None:
        """Count *frame*; a remote frame comes from a consumer and does not count."""
        identifier = (frame.can_id, frame.extended)
        if sent:
            self.sent.add(identifier)
        elif not frame.remote:
            self.others[identifier] = self.others.get(identifier, 0) + 1

    def may_hear(self, identifier: tuple[int, bool]) -> bool:
        """True if *identifier* was received, or may still be received within LISTENED_S."""
        return self.bus is not None and (identifier in self.others or self.bus.now_s() - self.since_s < LISTENED_S)

    def frames_of(self, identifier: tuple[int, bool]) -> int:
        """The number of frames received with *identifier*; waits for the rest of LISTENED_S if none yet."""
        while self.bus is not None and identifier not in self.others and self.bus.now_s() - self.since_s < LISTENED_S:
            self.bus.idle(AT_ONCE_S)
        return self.others.get(identifier, 0)

    def cannot_send(self, node_id: int) -> bool:
        """True if node *node_id* sent no PDO meanwhile: it reported another state than OPERATIONAL before and after."""
        silent = (NmtState.PRE_OPERATIONAL, NmtState.STOPPED)
        return self.bus is not None and {self.states.get(node_id), self.bus.nmt_state(node_id)} <= {*silent}


@contextmanager
def received_ids(bus: CanopenBus) -> Iterator[ReceivedIds]:
    """The frames on *bus* during the block; empty on a simulated bus with only known nodes."""
    if bus.simulated or not bus.carries_frames:
        yield ReceivedIds()
        return
    states = bus.nodes_seen()  # drains older frames, sent by a TPDO disabled meanwhile
    found = ReceivedIds(bus, bus.now_s(), states)
    end = bus.tap(found.note)
    try:
        yield found
    finally:
        end()


def seen_producer_findings(
    node: ReadableNode, changes: Mapping[Pdo, tuple[PdoConfig, PdoConfig]], received: ReceivedIds
) -> Iterator[Finding]:
    """An error for each TPDO of *changes* (before, after) with a new CAN-ID already sent by an unknown producer.

    Frames of enabled TPDOs of other known nodes do not count, nor frames of *node* unless impossible, nor NMT, SDO,
    heartbeats and LSS, whoever sends them: other rules check these.
    """
    for pdo, (now, want) in changes.items():
        held, cob_id = now.communication.cob_id, want.communication.cob_id
        identifier = (cob_id.can_id, cob_id.extended)
        if not pdo.is_tpdo or not cob_id.valid or identifier in received.sent or is_of_service(cob_id):
            continue
        is_own = held.valid and (held.can_id, held.extended) == identifier
        if not (identifier in received.others if is_own else received.may_hear(identifier)):
            continue
        cannot_send = received.cannot_send(node.node_id)
        if is_own and not cannot_send:
            continue
        own = [] if cannot_send else [at for other, at in node.known_cob_ids().items() if other.is_tpdo and at.valid]
        known = [*own, *(producer.cob_id for producer in producers(node.neighbours()))]
        if identifier in {(known_id.can_id, known_id.extended) for known_id in known}:
            continue
        if frames := received.frames_of(identifier):
            received_words = f"{frames} frame{'s' if frames > 1 else ''} received"
            text = f"CAN-ID {cob_id} is already on the bus, sent by an unknown node ({received_words})"
            hint = Hint(Action.CHECK_LIVE, why="asks every node") + Hint(
                Action.SELECT_CAN_ID, why="switch that TPDO off, take another CAN-ID, or {}"
            )
            yield error("one-producer", f"0x{pdo.communication_index:04X}:01", text, hint=hint)
