"""State of a network's nodes as values: PDOs and standard objects, from devices or files. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from dvtcli.domain.can_ids import TIME_ID
from dvtcli.domain.cob_id import OFF, PRODUCES, SYNC_BY_DEFAULT, can_id_text, is_channel_place
from dvtcli.domain.network.network_config import NOWHERE, Endpoint, LinkConfig, Mark, MasterRole
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.objects import (
    COB_ID_EMCY,
    COB_ID_SYNC,
    COB_ID_TIME,
    CONSUMER_HEARTBEAT,
    CYCLE_PERIOD,
    GUARD_TIME,
    LIFE_TIME_FACTOR,
    PRODUCER_HEARTBEAT,
)
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.profile import GENERIC, DeviceProfile, ObjectAddress
from dvtcli.domain.rules.finding import Finding

Identity = Mapping[str, int | None]

#: The sub-indices of 0x1018 from 1 on, as `Identity` names them.
IDENTITY_NAMES = ("vendor", "product", "revision", "serial")
_FRAME = 1 << 29


@dataclass(frozen=True, slots=True)
class NodeState:
    """A node: *pdos*, and *numbers* in other existing and readable objects.

    *name* is the node's name in a file, *title* the device's own name; *mark* is its place in the file. *asked*
    is the requested identity, by `Identity` names. *downloads* are a manager's downloads to other nodes by node-ID
    (0x1F22). *guessed* are PDOs whose mapping comes from another source, named in words, *unsaid* those whose mapping
    neither file nor EDS has. *said* are findings about the
    plan to this state; *places* are the places of objects in a file. *unresolved* are PDOs whose mapping in the file
    has an object that is unknown: their mapping here is not the file's.
    """

    node_id: int
    name: str = ""
    pdos: Mapping[Pdo, PdoConfig] = field(default_factory=dict)
    numbers: Mapping[ObjectAddress, int] = field(default_factory=dict)
    dictionary: ObjectDictionary | None = None
    profile: DeviceProfile = GENERIC
    title: str = ""
    mark: Mark = NOWHERE
    marks: Mapping[Pdo, Mark] = field(default_factory=dict)
    asked: Identity = field(default_factory=dict)
    downloads: Mapping[int, bytes] = field(default_factory=dict)
    guessed: Mapping[Pdo, str] = field(default_factory=dict)
    unsaid: frozenset[Pdo] = frozenset()
    said: tuple[Finding, ...] = ()
    places: Mapping[ObjectAddress, Mark] = field(default_factory=dict)
    unresolved: frozenset[Pdo] = frozenset()

    def number(self, index: int, sub_index: int = 0) -> int | None:
        """Value of an object, None if missing or unreadable."""
        return self.numbers.get((index, sub_index))

    def holds(self, index: int, sub_index: int) -> int | None:
        """Value of any known object, including PDO parameters."""
        pdo = Pdo.at(index)
        config = None if pdo is None else self.pdos.get(pdo)
        if pdo is None or config is None:
            return self.number(index, sub_index)
        return _communication(config, sub_index) if index == pdo.communication_index else _mapping(config, sub_index)

    def produces(self, index: int) -> bool:
        """Whether bit 30 of the COB-ID at *index*, that of SYNC or TIME, makes the node its producer."""
        cob_id = self.number(index)
        return cob_id is not None and bool(cob_id & PRODUCES)

    @property
    def produces_sync(self) -> bool:
        """Whether the node produces SYNC: bit 30 of 0x1005, and a period in 0x1006."""
        return self.produces(COB_ID_SYNC) and bool(self.number(CYCLE_PERIOD))

    @property
    def heartbeat_ms(self) -> int:
        """Heartbeat period in ms; 0 for none."""
        return self.number(PRODUCER_HEARTBEAT) or 0

    @property
    def is_guarded(self) -> bool:
        """Whether the life time, 0x100C times 0x100D, is not 0."""
        return bool((self.number(GUARD_TIME) or 0) * (self.number(LIFE_TIME_FACTOR) or 0))

    @property
    def slots(self) -> dict[int, int]:
        """The entries of 0x1016 by sub-index."""
        return {sub: value for (index, sub), value in self.numbers.items() if index == CONSUMER_HEARTBEAT and sub}

    @property
    def watched(self) -> dict[int, int]:
        """Monitored producers by node-ID, with the consumer time in ms (CiA 301, 7.5.2.19)."""
        used = (value for value in self.slots.values() if value & 0xFFFF and 1 <= value >> 16 & 0xFF <= 127)
        return {value >> 16 & 0xFF: value & 0xFFFF for value in used}

    @property
    def emcy(self) -> Identifier | None:
        """CAN-ID of the node's EMCY, and whether it has 29 bits; None if missing or disabled."""
        held = self.number(COB_ID_EMCY)
        return None if held is None or held & OFF else _identifier(held)

    @property
    def sdo_channels(self) -> dict[ObjectAddress, int]:
        """The COB-IDs of further SDO servers and clients (0x1201…, 0x1280…) and of SRDOs, by index and sub-index."""
        return {place: value for place, value in self.numbers.items() if is_channel_place(*place)}

    @property
    def sync(self) -> Identifier:
        """CAN-ID of SYNC in this node, 0x080 by default."""
        held = self.number(COB_ID_SYNC)
        return SYNC_BY_DEFAULT if held is None else _identifier(held)

    @property
    def time(self) -> Identifier:
        """CAN-ID of the time stamp in this node, 0x100 by default."""
        held = self.number(COB_ID_TIME)
        return (TIME_ID, False) if held is None else _identifier(held)


def _communication(config: PdoConfig, sub_index: int) -> int | None:
    """A communication parameter (CiA 301, 7.5.2.35 and 7.5.2.37)."""
    held = config.communication
    if sub_index == 1:
        return held.cob_id.raw if config.has_cob_id else None
    by_sub_index = {2: held.transmission_type, 3: held.inhibit_time, 5: held.event_timer, 6: held.sync_start_value}
    return by_sub_index.get(sub_index)


def _mapping(config: PdoConfig, sub_index: int) -> int | None:
    """An entry of a mapping, or the count; None if unknown, or beyond the count."""
    if not config.has_mapping:
        return None
    if sub_index == 0:
        return config.count
    return config.mapping[sub_index - 1].raw if sub_index <= len(config.mapping) else None


#: A CAN-ID, and whether it has 29 bits.
Identifier = tuple[int, bool]


def _identifier(held: int) -> Identifier:
    extended = bool(held & _FRAME)
    return held & (0x1FFF_FFFF if extended else 0x7FF), extended


def identifier_of(config: PdoConfig) -> Identifier:
    """The CAN-ID of a PDO, and whether it has 29 bits."""
    cob_id = config.communication.cob_id
    return cob_id.can_id, cob_id.extended


def identifier_text(identifier: Identifier) -> str:
    """A CAN-ID as printed: three digits, or eight if it has 29 bits."""
    return can_id_text(identifier[0], extended=identifier[1])


class NetworkState(NamedTuple):
    """Nodes by node-ID, the master if a file names it, and a file's requested links.

    *file* is the source, empty if nodes were read. *undescribed* are nodes without known contents.
    """

    nodes: tuple[NodeState, ...] = ()
    master: MasterRole | None = None
    links: tuple[LinkConfig, ...] = ()
    file: str = ""
    undescribed: tuple[int, ...] = ()

    def node(self, node_id: int) -> NodeState | None:
        """The node with *node_id*, None if missing."""
        return next((node for node in self.nodes if node.node_id == node_id), None)

    def enabled(self, *, is_tpdo: bool) -> Iterator[tuple[NodeState, Pdo, PdoConfig]]:
        """Every enabled PDO of one direction."""
        for node in self.nodes:
            for pdo, config in sorted(node.pdos.items()):
                if pdo.is_tpdo is is_tpdo and config.enabled:
                    yield node, pdo, config

    def producers(self, identifier: Identifier) -> list[tuple[Endpoint, PdoConfig]]:
        """The enabled TPDOs with *identifier*."""
        enabled = self.enabled(is_tpdo=True)
        return [(Endpoint(node.node_id, pdo), sent) for node, pdo, sent in enabled if identifier_of(sent) == identifier]

    @property
    def bit_rate(self) -> int | None:
        """The bus's bit rate in bit/s in the file's master section, else None."""
        return None if self.master is None else self.master.bit_rate

    @property
    def sync_periods_us(self) -> tuple[int, ...]:
        """Periods in µs of all SYNC producers, including the master."""
        periods = [node.number(CYCLE_PERIOD) or 0 for node in self.nodes if node.produces_sync]
        if self.master is not None and self.master.sync_period_us:
            periods.append(self.master.sync_period_us)
        return tuple(periods)
