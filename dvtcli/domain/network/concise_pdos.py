"""What a concise DCF downloads for a node to be as planned, in the order that masters' tools have made common.

Heartbeat and error behaviour first, then RPDOs, TPDOs, then other objects. A PDO is disabled, unless it is off
already; what differs of its communication parameter follows; of its mapping the count becomes 0, unless it maps nothing
yet, then come all entries and the count; last it is enabled. Pure; reads no node, and writes nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dvtcli.domain.cob_id import INVALID_BIT
from dvtcli.domain.network.concise_dcf import ConciseEntry
from dvtcli.domain.network.network_plan import NodePlan
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, ValueChange

_FIRST = (0x1017, 0x1029)


def concise_of(plan: NodePlan, mapped: Collection[Pdo]) -> tuple[ConciseEntry, ...]:
    """The downloads for what *plan* wants of a device as new; of *mapped* PDOs the mapping is written in any case."""
    changed = {change.pdo: change.before for change in plan.plan.changes if isinstance(change, PdoChange)}
    values = [step for change in plan.plan.changes if isinstance(change, ValueChange) for step in change.steps]
    first = sorted((step for step in values if step.index in _FIRST), key=lambda step: (step.index, step.sub_index))
    wanted = dict(sorted(plan.wanted.items(), key=lambda item: item[0].communication_index))
    entries = [ConciseEntry(step.index, step.sub_index, step.after) for step in first]
    for pdo, after in wanted.items():
        entries += _pdo(pdo, changed.get(pdo, after), after, always=pdo in mapped)
    said = {(step.index, step.sub_index) for step in first}
    rest = {place: data for place, data in plan.values.items() if place[0] not in _FIRST and place not in said}
    return (*entries, *(ConciseEntry(*place, data) for place, data in rest.items()))


def _pdo(pdo: Pdo, before: PdoConfig, after: PdoConfig, *, always: bool) -> Iterator[ConciseEntry]:
    if before == after and not always:
        return
    at, cob_id = pdo.communication_index, after.communication.cob_id.raw
    off = cob_id | INVALID_BIT
    if before.communication.cob_id.raw != off:
        yield _number(at, 1, off, 4)
    yield from _communication(pdo, before, after)
    if always or before.mapping != after.mapping:
        yield from _mapping(pdo, before, after)
    if after.communication.cob_id.valid:
        yield _number(at, 1, cob_id, 4)


def _communication(pdo: Pdo, before: PdoConfig, after: PdoConfig) -> Iterator[ConciseEntry]:
    held, wanted = before.communication, after.communication
    for sub_index, was, new, size in (
        (2, held.transmission_type, wanted.transmission_type, 1),
        (3, held.inhibit_time, wanted.inhibit_time, 2),
        (5, held.event_timer, wanted.event_timer, 2),
        (6, held.sync_start_value, wanted.sync_start_value, 1),
    ):
        if new is not None and new != was:
            yield _number(pdo.communication_index, sub_index, new, size)


def _mapping(pdo: Pdo, before: PdoConfig, after: PdoConfig) -> Iterator[ConciseEntry]:
    at = pdo.mapping_index
    if before.mapping:
        yield _number(at, 0, 0, 1)
    yield from (_number(at, place, entry.raw, 4) for place, entry in enumerate(after.mapping, 1))
    if after.mapping:
        yield _number(at, 0, len(after.mapping), 1)


def _number(index: int, sub_index: int, value: int, size: int) -> ConciseEntry:
    return ConciseEntry(index, sub_index, value.to_bytes(size, "little"))
