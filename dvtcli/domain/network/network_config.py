"""Requested configuration of a network's nodes as values; None or a missing entry leaves the value alone.

Object names stay words with their place in the file, as only a node's dictionary can resolve them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.objects import IDENTITY
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import ObjectAddress

_PLACE = re.compile(r"0x([0-9A-F]{4}):([0-9A-F]{2})")
_LINKED = re.compile(r"([0-9]+):([rt]pdo[0-9]+)")


@dataclass(frozen=True, slots=True, order=True)
class Mark:
    """A place in a file: line and column, both 1 and up, and length in characters. 0: made by a program."""

    line: int = 0
    column: int = 0
    width: int = 1


NOWHERE = Mark()


@dataclass(frozen=True, slots=True)
class FileWord:
    """A word of a file, resolved later like prompt input: `6041:00/16`, `statusword`, `dummy/8`."""

    text: str
    mark: Mark = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class PartialPdoConfig:
    """Requested PDO configuration. Units as in `PdoRequest`: *inhibit_time* counts 100 µs, *event_timer* 1 ms.

    *cob_id* is bits 28..0 or `auto`; *extended* is bit 29, *rtr_allowed* bit 30 clear, *enabled* bit 31 clear.
    *mapping* is the whole mapping in frame order, () for an empty mapping. *keys* are the keys' places in the file,
    by sub-index of the communication parameter, 0 for the mapping.
    """

    pdo: Pdo
    enabled: bool | None = None
    cob_id: int | Literal["auto"] | None = None
    extended: bool = False
    rtr_allowed: bool | None = None
    transmission_type: int | None = None
    inhibit_time: int | None = None
    event_timer: int | None = None
    sync_start_value: int | None = None
    mapping: tuple[FileWord, ...] | None = None
    mark: Mark = field(default=NOWHERE, compare=False)
    keys: Mapping[int, Mark] = field(default_factory=dict, compare=False)

    @property
    def marks(self) -> Iterator[tuple[ObjectAddress, Mark]]:
        """The requested objects, each with its place in the file."""
        for sub_index, mark in self.keys.items():
            index = self.pdo.communication_index if sub_index else self.pdo.mapping_index
            yield (index, sub_index), mark
        for number, word in enumerate(self.mapping or (), 1):
            if word.text.lower().startswith("dummy"):
                return  # it may take several entries
            yield (self.pdo.mapping_index, number), word.mark


@dataclass(frozen=True, slots=True)
class ObjectConfig:
    """Requested bytes of a standard object; *key* is the key in the file."""

    key: str
    index: int
    sub_index: int
    data: bytes
    mark: Mark = field(default=NOWHERE, compare=False)


class ValueConfig(NamedTuple):
    """Requested value, as typed, of an object of any type."""

    object: FileWord
    value: FileWord


@dataclass(frozen=True, slots=True)
class HeartbeatWatch:
    """An entry of 0x1016: the node monitors *producer* (node-ID 1..127), late after *time_ms*; 0 for no monitoring."""

    producer: int
    time_ms: int
    mark: Mark = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class PinConfig:
    """Requested object for *pin* (1 and up) in a group of virtual PDOs; None for no object."""

    group: str
    pin: int
    object: FileWord | None
    mark: Mark = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class ExpectedIdentity:
    """Numbers of 0x1018 that must match before any write to the node; None is not checked."""

    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    serial: int | None = None


@dataclass(frozen=True, slots=True)
class NodeConfig:
    """Requested node configuration, and options for dvtcli.

    *dcf* is the EDS, DCF, XDD or XDC, *store* the sub-index of 0x1010 stored afterwards (False: nothing), *prune*
    disables enabled PDOs that are not named, *stamp* writes a date to 0x1020, *physical* is the scaling of
    its objects: an object or several, and JSON as in a profile.
    """

    name: str
    node_id: int
    identity: ExpectedIdentity = ExpectedIdentity()
    profile: str | None = None
    dcf: FileWord | None = None
    pdos: tuple[PartialPdoConfig, ...] = ()
    objects: tuple[ObjectConfig, ...] = ()
    values: tuple[ValueConfig, ...] = ()
    watches: tuple[HeartbeatWatch, ...] = ()
    pins: tuple[PinConfig, ...] = ()
    store: bool | str | None = None
    prune: bool | None = None
    stamp: bool | None = None
    mark: Mark = field(default=NOWHERE, compare=False)
    #: place of `store`
    store_mark: Mark = field(default=NOWHERE, compare=False)
    physical: tuple[tuple[str, str], ...] = ()
    #: place of `profile`, and of *identity* by sub-index of 0x1018
    profile_mark: Mark = field(default=NOWHERE, compare=False)
    identity_marks: Mapping[int, Mark] = field(default_factory=dict, compare=False)
    #: modules of a modular device, by their numbers in *dcf*; None: as the file or the device says
    modules: tuple[int, ...] | None = None
    modules_mark: Mark = field(default=NOWHERE, compare=False)

    @property
    def asks_nothing(self) -> bool:
        """Whether no configuration is requested for the node."""
        return not (self.pdos or self.objects or self.values or self.watches or self.pins or self.prune or self.stamp)

    @property
    def marks(self) -> dict[ObjectAddress, Mark]:
        """The requested objects by number, each with its place in the file."""
        found = {(IDENTITY, sub_index): mark for sub_index, mark in self.identity_marks.items()}
        found |= {(config.index, config.sub_index): config.mark for config in self.objects}
        for value in self.values:
            try:
                place = parse_object(value.object.text)
            except ValueError:
                continue
            if place is not None:
                found[place] = value.object.mark
        return {**found, **{place: mark for pdo in self.pdos for place, mark in pdo.marks if mark.line}}


@dataclass(frozen=True, slots=True)
class MasterRole:
    """The master's role: never written. Times as in the file; None if not given.

    *bit_rate* is the bus's in bit/s.
    """

    node_id: int | None = None
    sync_period_us: int | None = None
    heartbeat_producer_ms: int | None = None
    bit_rate: int | None = None
    mark: Mark = field(default=NOWHERE, compare=False)


class Endpoint(NamedTuple):
    """A PDO of a node: `5:tpdo1`."""

    node_id: int
    pdo: Pdo


@dataclass(frozen=True, slots=True)
class LinkConfig:
    """A TPDO with its receiving RPDOs.

    *heartbeat* is False for no monitoring, or the producer's heartbeat in ms if set with the link; None to monitor an
    existing heartbeat.
    """

    producer: Endpoint
    consumers: tuple[Endpoint, ...]
    heartbeat: int | Literal[False] | None = None
    mark: Mark = field(default=NOWHERE, compare=False)

    @property
    def ends(self) -> tuple[Endpoint, ...]:
        """The producer and its consumers."""
        return (self.producer, *self.consumers)


class FileNote(NamedTuple):
    """A remark on a legal but unused part of a file; *mark* is its first place, *times* its frequency."""

    text: str
    mark: Mark
    times: int = 1


@dataclass(frozen=True, slots=True)
class NetworkConfig:
    """Requested nodes by node-ID, and their links.

    *multiplier* is the number of a producer's heartbeats after which its consumers report a loss, None for 3.
    """

    nodes: tuple[NodeConfig, ...] = ()
    links: tuple[LinkConfig, ...] = ()
    master: MasterRole | None = None
    multiplier: float | None = None
    notes: tuple[FileNote, ...] = field(default=(), compare=False)

    @property
    def asked_nothing(self) -> tuple[int, ...]:
        """Node-IDs without any requested configuration."""
        linked = {end.node_id for link in self.links for end in link.ends}
        return tuple(node.node_id for node in self.nodes if node.asks_nothing and node.node_id not in linked)

    def mark_of(self, node_id: int | None, place: str) -> Mark:
        """Place in the file for *place* (`0x1A00:03`, `TPDO1`, `5:tpdo1`), its PDO, or the node."""
        found, linked = _PLACE.fullmatch(place), _LINKED.fullmatch(place)
        node_id = int(linked[1]) if linked is not None else node_id
        node = next((node for node in self.nodes if node.node_id == node_id), None)
        if node is None:
            return NOWHERE
        if found is not None:
            number = (int(found[1], 16), int(found[2], 16))
            if (mark := node.marks.get(number, NOWHERE)).line:
                return mark
            pdo = Pdo.at(number[0])
        else:
            pdo = Pdo.parse(linked[2]) if linked is not None else None
            pdo = pdo or next((config.pdo for config in node.pdos if place == config.pdo.label), None)
        own_mark = next((config.mark for config in node.pdos if config.pdo == pdo and config.mark.line), NOWHERE)
        ends = (link.mark for link in self.links if any((end.node_id, end.pdo) == (node_id, pdo) for end in link.ends))
        return own_mark if own_mark.line else next(ends, node.mark)

    def of(self, ids: Collection[int]) -> NetworkConfig:
        """The part for the node-IDs *ids*, and the links between them."""
        nodes = tuple(node for node in self.nodes if node.node_id in ids)
        links = tuple(link for link in self.links if all(end.node_id in ids for end in link.ends))
        return replace(self, nodes=nodes, links=links)
