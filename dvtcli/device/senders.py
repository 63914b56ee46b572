"""The PDOs that the nodes of a network send and receive after a network-wide plan. Reads COB-IDs on demand."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.neighbours import channels_taken, producers, services_taken
from dvtcli.device.read_cache import read_side_by_side
from dvtcli.device.read_pdos import sdo_channels, service_ids
from dvtcli.domain.network.consumers import by_id
from dvtcli.domain.rules.finding import Producer
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.domain.cob_id import CobId
    from dvtcli.domain.network.consumers import Id
    from dvtcli.domain.pdo import Pdo


@dataclass(slots=True)
class Senders:
    """The TPDOs of *nodes*, as read for this plan, and their COB-IDs after the plan or by a file.

    *after* has the new COB-ID of each changed TPDO, by node-ID; None if it will be disabled, or its COB-ID is unknown
    yet.
    """

    nodes: Mapping[int, KnownPdos]
    after: dict[int, dict[Pdo, CobId | None]] = field(default_factory=dict)
    _now: dict[int, tuple[Producer, ...]] = field(default_factory=dict)
    _sent: Mapping[Id, Sequence[Producer]] | None = None
    _heard: Mapping[Id, Sequence[Producer]] | None = None
    _channels: Mapping[tuple[int, bool], str] | None = None

    def read_ahead(self, changed: Collection[int]) -> None:
        """Read the TPDOs of all nodes, and the services of *changed* nodes, in parallel.

        A read error of a service is reported at its first use; of a node that does not answer the known TPDOs count.
        """
        nodes = self.nodes.values()
        read_side_by_side(nodes, [partial(self._read_ahead, node, services=node.node_id in changed) for node in nodes])

    def _read_ahead(self, node: KnownPdos, *, services: bool) -> None:
        with suppress(NoAnswer, SdoAborted, SdoProtocolError):
            sdo_channels(node.memory.look(), node.dictionary)
            if services:
                service_ids(node.memory.look(), node.node_id, node.dictionary)
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

    def heard(self) -> Mapping[Id, Sequence[Producer]]:
        """Every enabled future RPDO of answering nodes by CAN-ID; fixed like `sent`."""
        if self._heard is None:
            self._heard = by_id(self._rpdos())
        return self._heard

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
