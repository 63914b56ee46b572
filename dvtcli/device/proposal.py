"""Judge a PDO request or a raw write by the rules, with the facts read from the node. Writes nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import takewhile
from typing import TYPE_CHECKING, Generic, TypeVar

from dvtcli.device.other_producers import enabled_pdos, producers, producers_of, services_taken
from dvtcli.device.read_pdos import learnt_objects, read_optional, service_ids, service_ids_beside
from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import SRDO_COB_IDS, SRDOS, SYNC_BY_DEFAULT, CobId, is_channel_place
from dvtcli.domain.pdo import MAX_ENTRIES, Pdo, PdoConfig, PdoMappingEntry, is_mpdo
from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange
from dvtcli.domain.process_data import answers_with_state
from dvtcli.domain.request import PdoRequest, entry_number, resolved
from dvtcli.domain.rules import Proposal
from dvtcli.domain.rules.can_id import COB_ID_OF, EMCY, SYNC, is_in_use, service_findings, service_taken_findings
from dvtcli.domain.rules.mapped_object import missing_object
from dvtcli.domain.rules.raw_write import (
    ParameterWrite,
    length_findings,
    parameter_findings,
    safety_findings,
    with_raw,
    write_findings,
)
from dvtcli.errors import RuleError, SdoAborted, UsageError

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.domain.rules.finding import Finding, Producer

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


class _Once(Generic[T]):
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
        node.node_id,
        pdo,
        now,
        want,
        others,
        node.profile,
        node.dictionary,
        lengths,
        _Once(lambda: {**taken(), **service_ids(node.read_cache.look(), node.node_id, node.dictionary)}),
        _Once(beside),
        cob_ids,
        absent,
        lambda: node.bus.nodes_seen().keys() - {node.node_id, *(other.node_id for other in node.neighbours())},
    )


def _others(
    node: ReadableNode, pdo: Pdo, together: Mapping[Pdo, PdoConfig]
) -> tuple[Mapping[Pdo, PdoConfig], Mapping[Pdo, CobId]]:
    """The other PDOs of *node* after the plan, and their COB-IDs, each read on first use."""

    def read() -> Mapping[Pdo, CobId]:
        held = {**node.known_cob_ids(), **{one: config.communication.cob_id for one, config in together.items()}}
        return {other: cob_id for other, cob_id in held.items() if other != pdo}

    cob_ids = _Once(read)

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
    beside = elsewhere or _Once(lambda: producers(node.neighbours()))
    held = proposal(node, pdo, now, now, elsewhere=beside)
    if isinstance(want, PdoRequest):
        if want.extended and not isinstance(want.cob_id, int):
            from dvtcli.domain.hint import Action, Hint

            raise UsageError(
                f"{pdo.label}: a CAN-ID of 29 bits is not chosen by itself",
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


def raw_write_findings(node: ReadableNode, index: int, sub_index: int, data: bytes) -> tuple[Finding, ...]:
    """All findings about writing *data* to *index*:*sub_index* of *node*."""
    findings = write_findings(node.dictionary, index, sub_index, data)
    pdo = Pdo.at(index)
    if index in COB_ID_OF and not sub_index and len(data) == 4 and not findings:
        return tuple(service_findings(node.node_id, index, int.from_bytes(data, "little")))
    if pdo is None or findings:
        return findings or safety_findings(index, sub_index)
    if wrong := length_findings(index, sub_index, data):
        return wrong
    now = node.pdo(pdo)
    write = ParameterWrite(index, sub_index, int.from_bytes(data, "little"))
    return parameter_findings(
        lambda want: proposal(node, pdo, now, want), now, write, lambda: _entries(node, pdo, write.value)
    )


def taken_can_id_findings(node: ReadableNode, index: int, sub_index: int, data: bytes) -> Iterator[Finding]:
    """An error if *data* gives a service of *node* a CAN-ID used by another service or an enabled PDO.

    Services are SYNC, the time stamp, EMCY, further SDO channels and SRDOs. Reads present values of *node* and the
    other known nodes, so only for a single write: a plan is judged by its result.
    """
    is_channel = is_channel_place(index, sub_index) and (index not in SRDOS or sub_index in SRDO_COB_IDS)
    raw = int.from_bytes(data, "little")
    if len(data) != 4 or not (is_channel or (index in COB_ID_OF and not sub_index)) or not is_in_use(index, raw):
        return
    # nodes share SYNC and the time stamp, and what is a server on one node is a client on another: EMCY is one node's
    shared = None if index == EMCY else index
    taken = services_taken(node.neighbours(), without=shared)
    taken |= service_ids_beside(node.read_cache, node.node_id, node.dictionary, without=index)
    if index != SYNC and "SYNC" not in taken.values():
        taken[SYNC_BY_DEFAULT] = "SYNC"
    for other in enabled_pdos((*node.neighbours(), node)):
        taken[other.cob_id.can_id, other.cob_id.extended] = f"that of {other.pdo.label} of node {other.node_id}"
    yield from service_taken_findings(index, sub_index, raw, taken)


def raw_change(node: ReadableNode, step: Step) -> Change:
    """The effect of a write: a PDO change if possible, to be undone and verified like any other.

    A parameter of unusual length is no PDO change: its effect on the device is unknown.
    """
    pdo, value = Pdo.at(step.index), int.from_bytes(step.after, "little")
    if pdo is None or length_findings(step.index, step.sub_index, step.after):
        return ValueChange(step)
    now = node.known_pdo(pdo)
    if step.index == pdo.communication_index:
        after = replace(now, communication=with_raw(now.communication, step.sub_index, value))
    elif step.sub_index == 0:
        after = _with_count(node, pdo, now, value)
    else:
        after = now  # an entry behind the count: nothing that is active changes
    return ValueChange(step) if after == now else PdoChange(pdo, now, after, (step,))


def _with_count(node: ReadableNode, pdo: Pdo, now: PdoConfig, count: int) -> PdoConfig:
    """*now* with *count*, as read back: an MPDO, or inconsistent if entries are missing."""
    if is_mpdo(count):
        first = _entries(node, pdo, 1)
        return replace(now, mapping=(), mpdo=count, held_count=None, unread=now.lacking, multiplexed=first)
    now = replace(now, mpdo=None, multiplexed=())
    entries = _entries(node, pdo, count)
    if len(entries) == count:
        return replace(now, mapping=entries, held_count=None, unread=now.lacking)
    gap = () if len(entries) == MAX_ENTRIES else ((pdo.mapping_index, len(entries) + 1),)
    return replace(now, mapping=entries, held_count=count, unread=(*now.lacking, *gap))


def _entries(node: ReadableNode, pdo: Pdo, count: int) -> tuple[PdoMappingEntry, ...]:
    """The mapping entries activated by a raw *count*."""
    numbers = range(1, min(count, MAX_ENTRIES) + 1)
    words = (read_optional(node.read_cache, pdo.mapping_index, number, 4) for number in numbers)
    return tuple(
        PdoMappingEntry.from_raw(word) for word in takewhile(lambda word: word is not None, words) if word is not None
    )


def held_value(node: ReadableNode, index: int, sub_index: int) -> bytes | None:
    """The present value for comparison and roll-back; None if it cannot be read back.

    This concerns write-only objects, and objects that return a state by the standard.
    """
    return None if answers_with_state(index) else readable_value(node, index, sub_index)


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
