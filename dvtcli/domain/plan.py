"""Plans: the writes to a device, their order and reasons; the only source of action.

A PDO is changed in the sequence of CiA 301; SYNC, TIME, EMCY, SDO and heartbeats have an order of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_scalings import ScaledValue, cut_text, value_text
from dvtcli.domain.objects import (
    COB_ID_EMCY,
    COB_ID_SYNC,
    COB_ID_TIME,
    CONSUMER_HEARTBEAT,
    CYCLE_PERIOD,
    FURTHER_SDO_CHANNELS,
    SYNC_OVERFLOW,
    VERIFY_CONFIGURATION,
)
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.text import hex_preview, join_some, plural

TRANSMISSION_TYPE, INHIBIT_TIME, EVENT_TIMER, SYNC_START = 2, 3, 5, 6
#: Transmission types of TPDOs sent on request (RTR).
ON_REQUEST = (252, 253)


class PdoChange(NamedTuple):
    """A PDO change from *before* to *after*, with its steps.

    *substitute* is the configuration to restore if the device refuses *before*, None if no refusal is expected.
    """

    pdo: Pdo
    before: PdoConfig
    after: PdoConfig
    steps: tuple[Step, ...]
    substitute: PdoConfig | None = None

    @property
    def label(self) -> str:
        """Name of the changed PDO: `TPDO1`."""
        return self.pdo.label

    def reversed(self) -> PdoChange:
        """The change that restores *before*."""
        return plan_pdo(self.pdo, self.after, self.before)


class ValueChange(NamedTuple):
    """A change of one object by itself, in one step, also of a single object of a PDO.

    A stamp changes to a new stamp by way of 0, the COB-ID of a service in use by way of an inactive COB-ID.
    """

    step: Step

    @property
    def label(self) -> str:
        """Name of the changed object: `1006:00`."""
        return self.step.object

    @property
    def is_readable(self) -> bool:
        """Whether the value can be read back: a write-only object has no known value before."""
        return self.step.before is not None

    @property
    def is_dependent(self) -> bool:
        """Whether the value must be written in an order with others (`order_of_dependent_values`)."""
        return is_dependent(self.step.index, self.step.sub_index)

    @property
    def steps(self) -> tuple[Step, ...]:
        """The steps of the change, if it stands alone."""
        before, after = self.step.before, self.step.after
        if self.is_dependent:
            return tuple(order_of_dependent_values((self.step,)))
        if self.step.index != VERIFY_CONFIGURATION or not any(before or b"") or not any(after):
            return (self.step,)
        nothing = bytes(len(after))
        return (
            replace(self.step, after=nothing, reason="the values that it covers change"),
            replace(self.step, before=nothing),
        )

    def reversed(self) -> ValueChange:
        """The change that restores the old value. Raises ValueError if the old value is unknown."""
        if self.step.before is None:
            raise ValueError(f"the value of 0x{self.step.object} before the change is not known")
        step = replace(self.step, before=self.step.after, after=self.step.before, reason="old value")
        return ValueChange(step)


Change = PdoChange | ValueChange


@dataclass(frozen=True, slots=True)
class Plan:
    """The changes for one node, in order.

    In a larger change, *looked_at* are PDOs that the caller reads completely after the last part, and rolls back with
    it.
    """

    node_id: int
    changes: tuple[Change, ...]
    looked_at: frozenset[Pdo] = frozenset()

    @property
    def steps(self) -> tuple[Step, ...]:
        """All steps of all changes, in order."""
        return tuple(step for _, step in self.steps_in_order())

    def steps_in_order(self) -> Iterator[tuple[Change, Step]]:
        """Every step in write order, each with its change.

        Interdependent values come together, at the place of the first of them.
        """
        dependent = {
            (change.step.index, change.step.sub_index): change
            for change in self.changes
            if isinstance(change, ValueChange) and change.is_dependent
        }
        is_done = False
        for change in self.changes:
            if not isinstance(change, ValueChange) or not change.is_dependent:
                yield from ((change, step) for step in change.steps)
            elif not is_done:
                is_done = True
                steps = order_of_dependent_values(value_change.step for value_change in dependent.values())
                yield from ((dependent[step.index, step.sub_index], step) for step in steps)

    def __len__(self) -> int:
        return sum(1 for _ in self.steps_in_order())

    def __repr__(self) -> str:
        labels = dict.fromkeys(change.label for change in self.changes)
        return f"<Plan of node {self.node_id}: {plural(len(self), 'step')} of {join_some(labels) or 'nothing'}>"

    @property
    def unreadable(self) -> tuple[ValueChange, ...]:
        """Changes of objects that cannot be read back."""
        return tuple(change for change in self.changes if isinstance(change, ValueChange) and not change.is_readable)

    def reversed(self) -> Plan:
        """The plan that undoes this plan."""
        return Plan(self.node_id, tuple(change.reversed() for change in reversed(self.changes)))


def alters(change: Change) -> bool:
    """Whether *change* has an effect; a write of the present value has none."""
    if isinstance(change, PdoChange):
        return change.before != change.after
    return change.step.before != change.step.after


def writes_cob_id(plan: Plan) -> bool:
    """Whether *plan* writes the COB-ID of a PDO, after which a device may move other PDOs."""
    return any(step.sub_index == 1 and step.index == _communication_index(step.index) for step in plan.steps)


def only_cob_id(change: Change) -> bool:
    """Whether *change* writes nothing but the COB-ID of a PDO."""
    place = (change.pdo.communication_index, 1) if isinstance(change, PdoChange) else None
    return bool(change.steps) and all((step.index, step.sub_index) == place for step in change.steps)


def _communication_index(index: int) -> int | None:
    pdo = Pdo.at(index)
    return None if pdo is None else pdo.communication_index


def plan_pdo(pdo: Pdo, now: PdoConfig, want: PdoConfig, *, disabled_first: bool = False) -> PdoChange:
    """The fewest writes that bring *pdo* from *now* to *want* in the order of CiA 301 (7.5.2.36, 7.5.2.38).

    Disable (bit 31 of the word that was read, bits 30 and 29 kept), communication parameters that differ,
    mapping count 0, all entries, count, enable. The PDO is disabled only if necessary and if still enabled; with
    *disabled_first* for any difference, for devices that require this.
    """
    return PdoChange(pdo, now, want, tuple(_pdo_steps(pdo, now, want, disabled_first=disabled_first)))


def _pdo_steps(pdo: Pdo, now: PdoConfig, want: PdoConfig, *, disabled_first: bool) -> Iterator[Step]:
    index = pdo.communication_index
    held = now.communication.cob_id
    wanted = want.communication.cob_id
    if disables(now, want) or (disabled_first and now.enabled and now != want):
        disabled = wanted if wanted == held.disabled() else held.disabled()
        yield _cob_id_step(index, held, disabled, "disable the PDO (bit 31)")
        held = disabled
    if needs_rtr_first(now, want):
        yield _cob_id_step(index, held, wanted.disabled(), "allow RTR, which the transmission type answers")
        held = wanted.disabled()
    yield from _communication_steps(index, now.communication, want.communication)
    if mapping_differs(now, want):
        yield from _mapping_steps(pdo.mapping_index, now, want)
    if held != wanted:
        what = "enable" if wanted.valid else "stays disabled"
        yield _cob_id_step(index, held, wanted, f"COB-ID {wanted}, {what}")


def needs_disabling(now: PdoConfig, want: PdoConfig) -> bool:
    """Whether the change affects values that CiA 301 freezes while a PDO is valid."""
    a, b = now.communication, want.communication
    return (
        a.cob_id != b.cob_id
        or a.inhibit_time != b.inhibit_time
        or a.sync_start_value != b.sync_start_value
        or mapping_differs(now, want)
    )


def needs_rtr_first(now: PdoConfig, want: PdoConfig) -> bool:
    """Whether a transmission type on RTR would be refused while bit 30 forbids RTR."""
    a, b = now.communication, want.communication
    return (
        b.transmission_type in ON_REQUEST
        and a.transmission_type != b.transmission_type
        and b.cob_id.rtr_allowed
        and not a.cob_id.rtr_allowed
    )


def disables(now: PdoConfig, want: PdoConfig) -> bool:
    """Whether the change from *now* to *want* disables an enabled PDO, so that it must be enabled again."""
    return now.enabled and needs_disabling(now, want)


def mapping_differs(now: PdoConfig, want: PdoConfig) -> bool:
    """Whether the change from *now* to *want* writes the mapping."""
    return now.entries != want.entries or now.count != want.count


def _cob_id_step(index: int, before: CobId, after: CobId, reason: str) -> Step:
    return Step(index, 1, before.raw.to_bytes(4, "little"), after.raw.to_bytes(4, "little"), reason)


def _communication_steps(index: int, now: PdoCommunicationParameter, want: PdoCommunicationParameter) -> Iterator[Step]:
    rows = (
        (TRANSMISSION_TYPE, 1, now.transmission_type, want.transmission_type, "transmission type {}"),
        (INHIBIT_TIME, 2, now.inhibit_time, want.inhibit_time, "inhibit time {} x 100 us"),
        (EVENT_TIMER, 2, now.event_timer, want.event_timer, "event timer {} ms"),
        (SYNC_START, 1, now.sync_start_value, want.sync_start_value, "SYNC start value {}"),
    )
    for sub_index, size, before, after, reason in rows:
        if after is not None and before != after:
            held = None if before is None else before.to_bytes(size, "little")
            yield Step(index, sub_index, held, after.to_bytes(size, "little"), reason.format(after))


def _mapping_steps(index: int, now: PdoConfig, want: PdoConfig) -> Iterator[Step]:
    if now.count:
        yield Step(index, 0, bytes([now.count]), b"\0", "open the mapping (count 0)")
    for number, entry in enumerate(want.entries, 1):
        held = now.entries[number - 1].raw.to_bytes(4, "little") if number <= len(now.entries) else None
        if want.mpdo is not None and (not entry.raw or (held is not None and now.entries[number - 1] == entry)):
            continue  # an MPDO's entry is no mapping: it stays
        yield Step(index, number, held, entry.raw.to_bytes(4, "little"), _entry_reason(entry))
    if want.count:
        yield Step(index, 0, b"\0", bytes([want.count]), f"close the mapping (count {want.count})")


def _entry_reason(entry: PdoMappingEntry) -> str:
    return f"skip {entry.bits} bits" if entry.is_dummy else f"map {entry}"


_SDO_COB_IDS = (1, 2)
_INVALID, _PRODUCES = 1 << 31, 1 << 30
#: bit 31 of TIME's COB-ID
_CONSUMES = 1 << 31
#: bits 29 to 0 of a COB-ID: frozen while its service uses it
_FROZEN = 0x3FFF_FFFF
_RELEASED = "release it: it is frozen or blocked"


@dataclass(frozen=True, slots=True)
class Step:
    """An SDO download: *before* is the object's value at this moment, None if it cannot be read.

    The step of a `ValueChange` without *before* is acknowledged by the device, not verified and not rolled back. In a
    `PdoChange`, an entry behind the count has none; it is verified and rolled back with the PDO.
    """

    index: int
    sub_index: int
    before: bytes | None
    after: bytes
    reason: str
    #: whether the value is the index of an object
    names_object: bool = False

    @property
    def object(self) -> str:
        """The object as printed and typed: `1A00:01`."""
        return f"{self.index:04X}:{self.sub_index:02X}"

    def otherwise(self, before: bytes | None, after: bytes, reason: str) -> Step:
        """The same object, from *before* to *after*."""
        return replace(self, before=before, after=after, reason=reason)

    def text(self, data: bytes | None) -> str:
        """*data* of the object in the usual notation: words and indices in hex, counts and times decimal."""
        if data is None:
            return "-"
        if not data:
            return "empty"
        value = int.from_bytes(data, "little")
        if self.names_object:
            return f"0x{value:04X}"
        return f"0x{value:08X}" if len(data) == 4 else str(value) if len(data) <= 2 else hex_preview(data)


def step_text(step: Step, data: bytes | None, known: ScaledValue | None) -> str:
    """*data* for the object in *step* with its meaning if *known*; else in the usual notation."""
    value = None if known is None else known.value(data)
    if known is None or value is None or isinstance(value, bytes):
        return step.text(data)
    if isinstance(value, str):
        return cut_text(value) if value.isprintable() else step.text(data)
    return value_text(value, known.meaning, 8 * len(data or b""))


def is_dependent(index: int, sub_index: int) -> bool:
    """Whether an object's value must be written in an order with others, or by way of another value."""
    if index in FURTHER_SDO_CHANNELS:
        return True
    return index in (COB_ID_SYNC, CYCLE_PERIOD, SYNC_OVERFLOW, COB_ID_TIME, COB_ID_EMCY) or (
        index == CONSUMER_HEARTBEAT and sub_index > 0
    )


def order_of_dependent_values(steps: Iterable[Step]) -> list[Step]:
    """Downloads that bring the objects in *steps*, one step each, to their new values in an order CiA 301 allows.

    Obstructive old values are released first: a service stops before its CAN-ID changes (7.5.2.5,
    7.5.2.15, 7.5.2.17, 7.5.2.33), the SYNC period is 0 while the counter's overflow changes (7.5.2.22), and of two
    consumer heartbeat times for one node the old time goes first (7.5.2.19). SYNC is produced once its period is set.
    Without releases each step is one download. The order also holds backwards.
    """
    wanted = list(steps)
    first, early, rest = list[Step](), list[Step](), list[Step]()
    for step in wanted:
        if step.index == CONSUMER_HEARTBEAT:
            continue
        released = _released(step, wanted)
        if released is None:
            rest.append(step)
        elif released == step.after:
            early.append(step)
        else:
            first.append(step.otherwise(step.before, released, _RELEASED))
            rest.append(step.otherwise(released, step.after, step.reason))
    consumers = _consumers([step for step in wanted if step.index == CONSUMER_HEARTBEAT])
    stopped = sorted((*first, *early), key=lambda step: step.index != COB_ID_SYNC)
    return [*stopped, *sorted(rest, key=_rank), *consumers]


def altering(steps: Iterable[Step]) -> list[Step]:
    """Steps with an effect, and a SYNC period beside a changing overflow, since the period must be released."""
    wanted = list(steps)
    overflow = any(step.index == SYNC_OVERFLOW and step.before != step.after for step in wanted)
    return [step for step in wanted if step.before != step.after or (overflow and step.index == CYCLE_PERIOD)]


def _released(step: Step, beside: Sequence[Step]) -> bytes | None:
    """Value for the object in *step* while other objects are written; None if it is not in the way."""
    if step.before is None:
        return None
    held, wanted = (int.from_bytes(data, "little") for data in (step.before, step.after))
    if step.index == CYCLE_PERIOD:
        overflow = any(download.index == SYNC_OVERFLOW and download.before != download.after for download in beside)
        return bytes(len(step.before)) if overflow and held else None
    stopped = _stopped(step, held)
    if stopped is None or held in (stopped, wanted):
        return None
    if (held ^ wanted) & _FROZEN or wanted == stopped:
        return stopped.to_bytes(len(step.before), "little")
    return None


def _stopped(step: Step, held: int) -> int | None:
    """The COB-ID *held* with its service disabled; None for any other object."""
    if step.index == COB_ID_SYNC:
        return held & ~_PRODUCES
    if step.index == COB_ID_TIME:
        return held & ~(_PRODUCES | _CONSUMES)
    if step.index == COB_ID_EMCY or (step.index in FURTHER_SDO_CHANNELS and step.sub_index in _SDO_COB_IDS):
        return held | _INVALID
    return None


def _rank(step: Step) -> int:
    """Sort key: the overflow before the period, the period before SYNC; an SDO channel's node before its COB-IDs."""
    if step.index == COB_ID_SYNC:
        return 2
    return 1 if step.index == CYCLE_PERIOD or _stopped(step, 0) is not None else 0


def _consumers(steps: Sequence[Step]) -> Iterator[Step]:
    """Consumer heartbeat times, each after other entries release its node; an entry is cleared to break a circle."""
    pending = list(steps)
    while pending:
        free = (
            step for step in pending if not any(_is_in_the_way(other, step) for other in pending if other is not step)
        )
        chosen = next(free, None)
        if chosen is not None:
            pending.remove(chosen)
            yield chosen
            continue
        blocking = next(
            step for step in pending if any(_is_in_the_way(step, other) for other in pending if other is not step)
        )
        cleared = blocking.otherwise(blocking.before, bytes(len(blocking.after)), _RELEASED)
        pending[pending.index(blocking)] = blocking.otherwise(cleared.after, blocking.after, blocking.reason)
        yield cleared


def _is_in_the_way(other: Step, step: Step) -> bool:
    """Whether *other* still waits for the new node of *step*."""
    node_id = _watched(step.after)
    return node_id is not None and node_id == _watched(other.before)


def _watched(data: bytes | None) -> int | None:
    """The node-ID of an entry in use: its time is not 0 (CiA 301, 7.5.2.19)."""
    raw = int.from_bytes(data or b"", "little")
    return raw >> 16 & 0xFF if raw & 0xFFFF else None
