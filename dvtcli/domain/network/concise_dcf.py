"""A concise DCF (CiA 302-3, 0x1F22): a manager's downloads to a node at each boot.

A number of entries (u32), then for each its index (u16), sub-index (u8), length (u32) and data, least significant
byte first. Other tools write files of this form for a master.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from dvtcli.domain.cob_id import INVALID_BIT
from dvtcli.domain.network.network_plan import NodePlan
from dvtcli.domain.objects import (
    COB_ID_TIME,
    CONCISE_DCF,
    CONSUMER_HEARTBEAT,
    ERROR_BEHAVIOUR,
    GUARD_TIME,
    LIFE_TIME_FACTOR,
    PRODUCER_HEARTBEAT,
)
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import PdoChange, Step, ValueChange, mapping_differs

#: Objects that are written before the PDOs, unless `sdo` sets them, in the order of dcfgen.
BEFORE_PDOS = (CONSUMER_HEARTBEAT, COB_ID_TIME, PRODUCER_HEARTBEAT, GUARD_TIME, LIFE_TIME_FACTOR, ERROR_BEHAVIOUR)


def concise_of(
    node_plan: NodePlan, mapped: Collection[Pdo], fixed: Collection[Pdo], own: Collection[tuple[int, int]]
) -> tuple[ConciseEntry, ...]:
    """Downloads that configure a new device as in *node_plan*.

    The mapping of *mapped* PDOs is always written, COB-IDs of enabled PDOs except *fixed*, and the values of `sdo`,
    objects *own*.
    """
    changed = {change.pdo: change.before for change in node_plan.plan.changes if isinstance(change, PdoChange)}
    values = [step for change in node_plan.plan.changes if isinstance(change, ValueChange) for step in change.steps]
    first = [step for step in values if step.index in BEFORE_PDOS and (step.index, step.sub_index) not in own]
    first.sort(key=lambda step: (BEFORE_PDOS.index(step.index), step.sub_index))
    rest = {place: data for place, data in node_plan.values.items() if place[0] not in BEFORE_PDOS or place in own}
    pdos = {pdo: (changed.get(pdo, after), after) for pdo, after in node_plan.wanted.items()}
    return (
        *(ConciseEntry(step.index, step.sub_index, step.after) for step in first),
        *_pdos(pdos, mapped, fixed),
        *(ConciseEntry(*place, data) for place, data in rest.items()),
    )


def concise_of_device(
    pdos: Mapping[Pdo, tuple[PdoConfig, PdoConfig]],
    mapped: Collection[Pdo],
    fixed: Collection[Pdo],
    values: Mapping[tuple[int, int], bytes],
) -> tuple[ConciseEntry, ...]:
    """Downloads that bring a device from the first configuration of its *pdos* to the second, and to *values*.

    The mapping of *mapped* PDOs is always written, the COB-ID of *fixed* ones never.
    """
    first = sorted(place for place in values if place[0] in BEFORE_PDOS)
    first.sort(key=lambda place: BEFORE_PDOS.index(place[0]))
    rest = sorted(values.keys() - set(first))
    return (
        *(ConciseEntry(*place, values[place]) for place in first),
        *_pdos(pdos, mapped, fixed),
        *(ConciseEntry(*place, values[place]) for place in rest),
    )


def _pdos(
    pdos: Mapping[Pdo, tuple[PdoConfig, PdoConfig]], mapped: Collection[Pdo], fixed: Collection[Pdo]
) -> Iterator[ConciseEntry]:
    for pdo, (before, after) in sorted(pdos.items(), key=lambda item: item[0].communication_index):
        yield from _pdo(pdo, before, after, always=pdo in mapped, is_fixed=pdo in fixed)


def _pdo(pdo: Pdo, before: PdoConfig, after: PdoConfig, *, always: bool, is_fixed: bool) -> Iterator[ConciseEntry]:
    is_switched = after.communication.cob_id.valid and not is_fixed
    if before == after and not always and not is_switched:
        return
    at, cob_id = pdo.communication_index, after.communication.cob_id.raw
    off = cob_id | INVALID_BIT
    if before.communication.cob_id.raw != off and not is_fixed:
        yield _number(at, 1, off, 4)
    yield from _communication(pdo, before, after)
    if always or mapping_differs(before, after):
        yield from _mapping(pdo, before, after)
    if is_switched:
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
    if before.count or after.count:
        yield _number(at, 0, 0, 1)
    for place, entry in enumerate(after.entries, 1):
        if after.mpdo is None or (entry.raw and entry not in before.entries[:1]):  # an MPDO keeps its object
            yield _number(at, place, entry.raw, 4)
    if after.count:
        yield _number(at, 0, after.count, 1)


def _number(index: int, sub_index: int, value: int, size: int) -> ConciseEntry:
    return ConciseEntry(index, sub_index, value.to_bytes(size, "little"))


#: maximum number of objects listed individually
_MOST = 12
_SAME = "the same values, downloaded in another order or in other steps"


def download_lines(place: str, before: bytes | None, after: bytes | None) -> Iterator[str]:
    """Differences between the downloads *before* and *after* of the object *place*, as printed, in lines.

    Empty if the object holds no downloads, or if either value is invalid.
    """
    if place[:4] != f"{CONCISE_DCF:04X}" or before is None or after is None or before == after:
        return
    try:
        was, will = (read_concise_dcf(data) if data else {} for data in (before, after))
    except ValueError:
        return
    lines = [
        f"{_step(*at).object}  {_text(at, was)} -> {_text(at, will)}"
        for at in sorted({*was, *will})
        if was.get(at) != will.get(at)
    ]
    node = f"node {int(place[5:], 16)}"
    yield from (f"{node}  {line}" for line in (lines or [_SAME])[:_MOST])
    if len(lines) > _MOST:
        yield f"{node}  and {len(lines) - _MOST} more objects"


def _step(index: int, sub_index: int) -> Step:
    return Step(index, sub_index, None, b"", "")


def _text(at: tuple[int, int], values: dict[tuple[int, int], bytes]) -> str:
    return _step(*at).text(values[at]) if at in values else "not downloaded"


#: suffix of such files
SUFFIX = ".cdcf"
_COUNT, _HEAD = 4, 7


@dataclass(frozen=True, slots=True)
class ConciseEntry:
    """A download: *data* to the object at *index* and *sub_index*."""

    index: int
    sub_index: int
    data: bytes

    @property
    def object(self) -> str:
        """The object as printed and typed: `1A00:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"


def concise_entries(data: bytes) -> tuple[ConciseEntry, ...]:
    """The entries in download order. Raises ValueError if *data* is not a concise DCF."""
    wanted, at = int.from_bytes(data[:_COUNT], "little"), _COUNT
    if len(data) < _COUNT:
        raise ValueError(f"{len(data)} bytes are too few for its number of entries")
    found: list[ConciseEntry] = []
    for number in range(1, wanted + 1):
        head, at = data[at : at + _HEAD], at + _HEAD
        size = int.from_bytes(head[3:], "little")
        if len(head) < _HEAD or at + size > len(data):
            raise ValueError(f"it ends in entry {number} of {wanted}")
        found.append(ConciseEntry(int.from_bytes(head[:2], "little"), head[2], data[at : at + size]))
        at += size
    if at != len(data):
        raise ValueError(f"{len(data) - at} bytes are behind its {wanted} entries")
    return tuple(found)


def read_concise_dcf(data: bytes) -> dict[tuple[int, int], bytes]:
    """Final value of each object, by index and sub-index. Raises ValueError if *data* is not a concise DCF.

    The last of several entries for one object counts, since they are downloaded in order.
    """
    return {(entry.index, entry.sub_index): entry.data for entry in concise_entries(data)}


def concise_bytes(entries: Sequence[ConciseEntry]) -> bytes:
    """*entries* as a concise DCF."""
    heads = (
        entry.index.to_bytes(2, "little")
        + bytes([entry.sub_index])
        + len(entry.data).to_bytes(4, "little")
        + entry.data
        for entry in entries
    )
    return len(entries).to_bytes(_COUNT, "little") + b"".join(heads)
