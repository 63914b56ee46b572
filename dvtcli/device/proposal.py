"""What the rules look at before a PDO of a node may be changed. Reads what they need to know; judges nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Generic, TypeVar

from dvtcli.device.neighbours import producers, producers_of, services_taken
from dvtcli.device.read_pdos import learnt_objects, service_ids
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.rules import Proposal

if TYPE_CHECKING:
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.domain.rules.finding import Producer


T = TypeVar("T")


class LazyMapping(Mapping[Pdo, T], Generic[T]):
    """Something about each of the PDOs that *which* tells, by *load*: an event timer needs none of that traffic."""

    def __init__(self, which: Callable[[], Iterable[Pdo]], load: Callable[[Pdo], T]) -> None:
        self._which, self._load = which, load

    def __getitem__(self, pdo: Pdo) -> T:
        return self._load(pdo)

    def __iter__(self) -> Iterator[Pdo]:
        return iter(self._which())

    def __len__(self) -> int:
        return sum(1 for _ in self)


#: What other nodes send, asked for when a rule first looks at it.
Elsewhere = Callable[[], "Collection[Producer]"]
#: The CAN-IDs of further SDO channels of known nodes, each with what it is, asked for likewise.
Channels = Callable[[], Mapping[tuple[int, bool], str]]


def proposal(
    node: KnownPdos,
    pdo: Pdo,
    now: PdoConfig,
    want: PdoConfig,
    together: Mapping[Pdo, PdoConfig] | None = None,
    elsewhere: Elsewhere | None = None,
    channels: Channels | None = None,
) -> Proposal:
    """What the rules look at before *pdo* of *node* may become *want*; *together* are PDOs changed in the same plan.

    *elsewhere* is what the other nodes will send, None for what they send now (for a COB-ID that stays: with it);
    *channels* are the further SDO channels of all known nodes, None for all services of its neighbours as they are now.
    """
    learn = node.dictionary is None and now.mapping != want.mapping
    lengths, absent = learnt_objects(want.mapping, node.memory.upload) if learn else ({}, {})
    others, cob_ids = _others(node, pdo, together or {})
    taken = channels or (lambda: services_taken(node.neighbours()))
    cob_id = want.communication.cob_id
    stays = now.communication.cob_id == cob_id
    beside = elsewhere or (lambda: producers_of(node.neighbours(), cob_id) if stays else producers(node.neighbours()))
    return Proposal(
        node.node_id,
        pdo,
        now,
        want,
        others,
        node.profile,
        node.dictionary,
        lengths,
        cache(lambda: {**taken(), **service_ids(node.memory.look(), node.node_id, node.dictionary)}),
        cache(beside),
        cob_ids,
        absent,
    )


def _others(
    node: KnownPdos, pdo: Pdo, together: Mapping[Pdo, PdoConfig]
) -> tuple[Mapping[Pdo, PdoConfig], Mapping[Pdo, CobId]]:
    """The other PDOs of *node* as they will be, and their COB-IDs; each is read when a rule first looks at it."""

    @cache
    def cob_ids() -> Mapping[Pdo, CobId]:
        held = {**node.known_cob_ids(), **{one: config.communication.cob_id for one, config in together.items()}}
        return {other: cob_id for other, cob_id in held.items() if other != pdo}

    def whole(other: Pdo) -> PdoConfig:
        return together[other] if other in together else node.known_pdo(other)

    return LazyMapping(cob_ids, whole), LazyMapping(cob_ids, lambda other: cob_ids()[other])
