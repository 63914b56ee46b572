"""The network as the subject of `check`, and the place of a finding."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from dvtcli.domain.cob_id import taken_by_services
from dvtcli.domain.network.network_config import NOWHERE, Mark
from dvtcli.domain.network.network_state import Identifier, NetworkState, NodeState, identifier_of
from dvtcli.domain.network.received_traffic import ReceivedTraffic
from dvtcli.domain.network.worst_case_load import SYNCHRONOUS, Streams, WorstCaseLoad, streams_of, worst_case_load
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from dvtcli.domain.rules.finding import disabled_and_empty


def judged_pdos(node: NodeState) -> Iterator[tuple[Pdo, Finding]]:
    """Findings of `map` for each PDO that is enabled, or named in a file, set up one after the other."""
    before: dict[Pdo, PdoConfig] = {}
    emcy = node.number(COB_ID_EMCY)
    for pdo, config in sorted(node.pdos.items()):
        if (not config.enabled and pdo not in node.marks) or config.inconsistency or config.mpdo is not None:
            continue
        proposal = Proposal(
            node_id=node.node_id,
            pdo=pdo,
            now=disabled_and_empty(config),
            want=config,
            others=before,
            profile=node.profile,
            dictionary=node.dictionary,
            services=lambda: taken_by_services(node.node_id, node.number(COB_ID_SYNC), emcy, node.sdo_channels),
        )
        yield from ((pdo, finding) for finding in check_pdo(proposal))
        before = {**before, pdo: config}


@dataclass(frozen=True, slots=True)
class NetSpot:
    """Place of a finding: a node, a PDO, or an object; empty for the whole network."""

    node_id: int | None = None
    pdo: Pdo | None = None
    index: int | None = None
    sub_index: int = 0

    @property
    def object(self) -> str:
        """The object as printed, empty for none."""
        return "" if self.index is None else f"{self.index:04X}:{self.sub_index:02X}"


#: Findings of a rule: place and text.
NetFound = Iterator[tuple[NetSpot, str]]


class PdoConnection(NamedTuple):
    """An RPDO that receives a TPDO: consumer first."""

    consumer: NodeState
    rpdo: Pdo
    takes: PdoConfig
    producer: NodeState
    tpdo: Pdo
    sends: PdoConfig

    @property
    def spot(self) -> NetSpot:
        """The place of the connection: the consumer."""
        return NetSpot(self.consumer.node_id, self.rpdo)

    @property
    def sender(self) -> str:
        """The TPDO, in words."""
        return f"{self.tpdo.label} of node {self.producer.node_id}"


@dataclass(frozen=True)
class CheckedNetwork:
    """A network *state* on a bus at *bit_rate* bit/s, None if unknown: no rule assumes a bit rate.

    *traffic* are the recorded frames, None without recording. *present* are the nodes on the bus if a file's network
    is compared with it, else None.
    """

    state: NetworkState
    bit_rate: int | None
    traffic: ReceivedTraffic | None = None
    present: frozenset[int] | None = None

    @cached_property
    def nodes(self) -> tuple[NodeState, ...]:
        """Every node."""
        return self.state.nodes

    @cached_property
    def described(self) -> tuple[NodeState, ...]:
        """Nodes with known contents."""
        return tuple(node for node in self.nodes if node.node_id not in self.state.undescribed)

    @cached_property
    def judged(self) -> tuple[tuple[int, Pdo, Finding], ...]:
        """Findings of the `map` rules about each enabled PDO."""
        return tuple((node.node_id, *found) for node in self.described for found in judged_pdos(node))

    @cached_property
    def streams(self) -> Streams:
        """All streams and their maximum frequency."""
        return streams_of(self.state)

    @cached_property
    def need(self) -> WorstCaseLoad | None:
        """Bus needs of all streams, None if the bit rate is unknown."""
        return None if self.bit_rate is None else worst_case_load(self.streams, self.bit_rate)

    @cached_property
    def tpdos(self) -> tuple[tuple[NodeState, Pdo, PdoConfig], ...]:
        """Every enabled TPDO."""
        return tuple(self.state.enabled(is_tpdo=True))

    @cached_property
    def rpdos(self) -> tuple[tuple[NodeState, Pdo, PdoConfig], ...]:
        """Every enabled RPDO."""
        return tuple(self.state.enabled(is_tpdo=False))

    @cached_property
    def enabled(self) -> tuple[tuple[NodeState, Pdo, PdoConfig], ...]:
        """Every enabled PDO."""
        return (*self.tpdos, *self.rpdos)

    @cached_property
    def received(self) -> tuple[PdoConnection, ...]:
        """Every RPDO with each TPDO of another node that it receives."""
        sent: dict[Identifier, list[tuple[NodeState, Pdo, PdoConfig]]] = {}
        for tpdo in self.tpdos:
            sent.setdefault(identifier_of(tpdo[2]), []).append(tpdo)
        return tuple(
            PdoConnection(consumer=consumer, rpdo=rpdo, takes=takes, producer=producer, tpdo=tpdo, sends=sends)
            for consumer, rpdo, takes in self.rpdos
            for producer, tpdo, sends in sent.get(identifier_of(takes), ())
            if producer.node_id != consumer.node_id
        )

    @cached_property
    def synchronous(self) -> tuple[tuple[NodeState, Pdo, PdoConfig], ...]:
        """Every enabled synchronous PDO."""
        return tuple(row for row in self.enabled if row[2].communication.transmission_type in SYNCHRONOUS)

    @cached_property
    def sent(self) -> frozenset[Identifier]:
        """Every CAN-ID of a TPDO."""
        return frozenset(identifier_of(config) for _, _, config in self.tpdos)


def mark_of(state: NetworkState, spot: NetSpot) -> Mark:
    """Place in the file for the object at *spot*, else for its PDO, else for the node."""
    node = None if spot.node_id is None else state.node(spot.node_id)
    if node is None:
        return NOWHERE
    if spot.index is not None and (spot.index, spot.sub_index) in node.places:
        return node.places[spot.index, spot.sub_index]
    return node.mark if spot.pdo is None else node.marks.get(spot.pdo, node.mark)


def at(node: NodeState, pdo: Pdo | None = None) -> NetSpot:
    """The spot of *node* or its *pdo*."""
    return NetSpot(node.node_id, pdo)


def held(node: NodeState, index: int, sub_index: int = 0) -> NetSpot:
    """The spot of an object of *node*."""
    return NetSpot(node.node_id, None, index, sub_index)
