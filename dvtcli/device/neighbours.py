"""The PDOs and services that the other nodes of a session send."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import UNREADABLE, read_cob_id, sdo_channels, service_ids_beside
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.rules.finding import Producer
from dvtcli.domain.services import taken_by_channels
from dvtcli.errors import NoAnswer, SdoAborted, SdoProtocolError

if TYPE_CHECKING:
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.ports import SdoReader


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
                found |= taken_by_channels(node.node_id, sdo_channels(node.memory.look(), node.dictionary))
    return found


def services_taken(nodes: Iterable[ReadableNode], *, without: int | None = None) -> dict[tuple[int, bool], str]:
    """CAN-IDs of SYNC, EMCY, TIME and further SDO channels of *nodes* (see `channels_taken`), except *without*."""
    found: dict[tuple[int, bool], str] = {}
    for node in nodes:
        if node.dictionary is not None or node.last_seen:
            with suppress(NoAnswer, SdoProtocolError):
                found |= service_ids_beside(node.memory.look(), node.node_id, node.dictionary, without=without)
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
    for pdo, cob_id in _cob_ids(node, node.sdo if anew else node.memory.look()).items():
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
    node.memory.forget_one(pdo.communication_index, 1)
    try:
        return read_cob_id(node.memory.look(), pdo)
    except SdoAborted as aborted:
        if pdo not in known and aborted.code not in UNREADABLE:
            raise
        return known.get(pdo)
