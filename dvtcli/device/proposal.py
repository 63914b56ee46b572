"""The proposal of a PDO request, with the facts that the rules need, read from the node. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Generic, TypeVar

from dvtcli.device.other_producers import producers, producers_of, services_taken
from dvtcli.device.read_pdos import learnt_objects, read_optional, service_ids
from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.request import PdoRequest, entry_number, resolved
from dvtcli.domain.rules import Proposal
from dvtcli.domain.rules.mapped_object import missing_object
from dvtcli.errors import RuleError, SdoAborted, UsageError

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.domain.request import AnyPdoRequest
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


class _Lazy(Generic[T]):
    """The result of *load*, called at the first use; much cheaper to make than a `functools.cache`."""

    __slots__ = ("_found", "_load")

    def __init__(self, load: Callable[[], T]) -> None:
        self._load = load
        self._found: tuple[T] | None = None

    def __call__(self) -> T:
        if self._found is None:
            self._found = (self._load(),)
        return self._found[0]


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
    ones, for an unchanged COB-ID only those that have it; *channels* are the further SDO channels of all known nodes,
    None for all present services of its neighbours.
    """
    learn = node.dictionary is None and now.mapping != want.mapping
    lengths, absent = learnt_objects(want.mapping, node.read_cache.upload) if learn else ({}, {})
    others, cob_ids = _others(node, pdo, together or {})
    taken = channels or (lambda: services_taken(node.neighbours()))
    cob_id = want.communication.cob_id
    stays = now.communication.cob_id == cob_id
    beside = elsewhere or (lambda: producers_of(node.neighbours(), cob_id) if stays else producers(node.neighbours()))
    return Proposal(
        node_id=node.node_id,
        pdo=pdo,
        now=now,
        want=want,
        others=others,
        profile=node.profile,
        dictionary=node.dictionary,
        lengths=lengths,
        services=_Lazy(lambda: {**taken(), **service_ids(node.read_cache.look(), node.node_id, node.dictionary)}),
        elsewhere=_Lazy(beside),
        cob_ids=cob_ids,
        absent=absent,
        unread=lambda: node.bus.nodes_seen().keys() - {node.node_id, *(other.node_id for other in node.neighbours())},
    )


def _others(
    node: ReadableNode, pdo: Pdo, together: Mapping[Pdo, PdoConfig]
) -> tuple[Mapping[Pdo, PdoConfig], Mapping[Pdo, CobId]]:
    """The other PDOs of *node* after the plan, and their COB-IDs, each read on first use."""

    def read() -> Mapping[Pdo, CobId]:
        held = {**node.known_cob_ids(), **{one: config.communication.cob_id for one, config in together.items()}}
        return {other: cob_id for other, cob_id in held.items() if other != pdo}

    cob_ids = _Lazy(read)

    def whole(other: Pdo) -> PdoConfig:
        return together[other] if other in together else node.known_pdo(other)

    return LazyMapping(cob_ids, whole), LazyMapping(cob_ids, lambda other: cob_ids()[other])


Lengths = Mapping["ObjectAddress", int | None]


def untyped_lengths(node: ReadableNode, wants: Iterable[AnyPdoRequest]) -> Lengths:
    """Lengths in bits of the objects named without a length in *wants*, from the EDS or *node*; None if unknown."""
    places = [place for want in wants if isinstance(want, PdoRequest) for place in want.untyped_lengths]
    return {place: node.length_of(*place) for place in dict.fromkeys(places)}


def resolve(
    node: ReadableNode,
    pdo: Pdo,
    now: PdoConfig,
    want: AnyPdoRequest,
    lengths: Lengths,
    elsewhere: Elsewhere | None = None,
) -> PdoConfig:
    """The configuration requested by *want* for *pdo* of *node*, now *now*; *lengths* come from `untyped_lengths`.

    *elsewhere* are the future PDOs of the other nodes, None for the present. Raises RuleError for an object missing in
    the EDS, UsageError for any other unresolvable request.
    """
    beside = elsewhere or _Lazy(lambda: producers(node.neighbours()))
    held = proposal(node, pdo, now, now, elsewhere=beside)
    if isinstance(want, PdoRequest):
        if want.extended and not isinstance(want.cob_id, int):
            from dvtcli.domain.hint import Action, Hint

            raise UsageError(
                f"{pdo.label}: a 29-bit CAN-ID is not chosen automatically",
                node=node.node_id,
                hint=Hint(Action.GIVE, {"cob_id": "CAN_ID"}, "{} says which"),
            )
        _refuse_missing(held, want, [place for place in want.untyped_lengths if lengths[place] is None])
    try:
        config = resolved(want, held, lengths)
    except ValueError as wrong:
        raise UsageError(f"{pdo.label}: {wrong}", node=node.node_id) from wrong
    if isinstance(want, PdoRequest) and want.mpdo is not None:
        first = read_optional(node.read_cache, pdo.mapping_index, 1, 4)
        config = replace(config, multiplexed=() if first is None else (PdoMappingEntry.from_raw(first),))
    return config


def _refuse_missing(held: Proposal, want: PdoRequest, unknown: Iterable[ObjectAddress]) -> None:
    """Raise RuleError for an object of *unknown* length that is missing in the EDS."""
    dictionary = held.dictionary
    for index, sub_index in unknown:
        if dictionary is not None and dictionary.entry(index, sub_index) is None:
            number = entry_number(want.objects or (), (index, sub_index), held)
            finding = missing_object(dictionary, held.mapping_place(number), index, sub_index)
            text = f"{held.pdo.label} not changed: {finding.text}"
            raise RuleError(text, [finding], node=held.node_id)


def readable_value(node: ReadableNode, index: int, sub_index: int) -> bytes | None:
    """The present value; None if the object is write-only, by the file or by the device's answer."""
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    if entry is not None and not entry.access.readable:
        return None
    try:
        return node.known_value(index, sub_index)
    except SdoAborted as aborted:
        if aborted.code in (Abort.WRITE_ONLY, Abort.UNSUPPORTED_ACCESS):
            return None
        raise
