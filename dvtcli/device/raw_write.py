"""A single write by index: its findings, and its effect as a change that can be verified and undone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile
from typing import TYPE_CHECKING

from dvtcli.device.other_producers import enabled_pdos, services_taken
from dvtcli.device.proposal import proposal, readable_value
from dvtcli.device.read_pdos import read_optional, service_ids_beside
from dvtcli.domain.cob_id import SRDO_COB_IDS, SYNC_BY_DEFAULT, is_channel_place
from dvtcli.domain.objects import COB_ID_EMCY, COB_ID_SYNC, SRDO_COMMUNICATION
from dvtcli.domain.pdo import MAX_ENTRIES, Pdo, PdoConfig, PdoMappingEntry, is_mpdo
from dvtcli.domain.plan import Change, PdoChange, Step, ValueChange
from dvtcli.domain.process_data import answers_with_state
from dvtcli.domain.rules.can_id import COB_ID_OF, is_in_use, service_findings, service_taken_findings
from dvtcli.domain.rules.raw_write import (
    ParameterWrite,
    length_findings,
    parameter_findings,
    safety_findings,
    with_raw,
    write_findings,
)

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.rules.finding import Finding


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
    is_channel = is_channel_place(index, sub_index) and (index not in SRDO_COMMUNICATION or sub_index in SRDO_COB_IDS)
    raw = int.from_bytes(data, "little")
    if len(data) != 4 or not (is_channel or (index in COB_ID_OF and not sub_index)) or not is_in_use(index, raw):
        return
    # nodes share SYNC and the time stamp, and what is a server on one node is a client on another: EMCY is one node's
    shared = None if index == COB_ID_EMCY else index
    taken = services_taken(node.neighbours(), without=shared)
    taken |= service_ids_beside(node.read_cache, node.node_id, node.dictionary, without=index)
    if index != COB_ID_SYNC and "SYNC" not in taken.values():
        taken[SYNC_BY_DEFAULT] = "SYNC"
    for other in enabled_pdos((*node.neighbours(), node)):
        taken[other.cob_id.can_id, other.cob_id.extended] = f"that of {other.pdo.label} of node {other.node_id}"
    yield from service_taken_findings(index, sub_index, raw, taken)


def raw_change(node: ReadableNode, step: Step) -> Change:
    """The effect of a write: a PDO change if possible, to be undone and verified like any other.

    A parameter of unusual length is not a PDO change: its effect on the device is unknown.
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
