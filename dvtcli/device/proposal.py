"""Read the facts that the rules need before a change of a PDO."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Generic, TypeVar

from dvtcli.device.other_producers import producers, producers_of, services_taken
from dvtcli.device.read_pdos import learnt_objects, service_ids
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.rules import Proposal

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.rules.finding import Producer


T = TypeVar("T")


class LazyMapping(Mapping[Pdo, T], Generic[T]):
    """A value per PDO of *which*, read by *load* on first use: an event timer needs none of this traffic."""

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
    node: ReadableNode,
    pdo: Pdo,
    now: PdoConfig,
    want: PdoConfig,
    together: Mapping[Pdo, PdoConfig] | None = None,
    elsewhere: Elsewhere | None = None,
    channels: Channels | None = None,
) -> Proposal:
    """The facts for the rules before *pdo* of *node* becomes *want*, with PDOs changed *together* in the plan.

    *elsewhere* are the future TPDOs of the other nodes, all or those with the CAN-ID of *want*; None for the present
    ones, for an unchanged COB-ID only those that have it;
    *channels* are the further SDO channels of all known nodes, None for all present services of its neighbours.
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
    node: ReadableNode, pdo: Pdo, together: Mapping[Pdo, PdoConfig]
) -> tuple[Mapping[Pdo, PdoConfig], Mapping[Pdo, CobId]]:
    """The other PDOs of *node* after the plan, and their COB-IDs, each read on first use."""

    @cache
    def cob_ids() -> Mapping[Pdo, CobId]:
        held = {**node.known_cob_ids(), **{one: config.communication.cob_id for one, config in together.items()}}
        return {other: cob_id for other, cob_id in held.items() if other != pdo}

    def whole(other: Pdo) -> PdoConfig:
        return together[other] if other in together else node.known_pdo(other)

    return LazyMapping(cob_ids, whole), LazyMapping(cob_ids, lambda other: cob_ids()[other])
