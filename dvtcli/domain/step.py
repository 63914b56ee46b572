"""One write of a plan, and the order of writes to the objects of SYNC, TIME, EMCY, SDO and heartbeats."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from dvtcli.domain.object_scalings import ScaledValue, cut_text, value_text
from dvtcli.domain.text import hex_preview

SYNC_COB_ID, SYNC_PERIOD, SYNC_OVERFLOW = 0x1005, 0x1006, 0x1019
TIME_COB_ID, EMCY_COB_ID, CONSUMER_TIMES = 0x1012, 0x1014, 0x1016
#: SDO server and client parameters (CiA 301, 7.5.2.33 and 7.5.2.34), except the read-only default channel
SDO_CHANNELS = range(0x1201, 0x1300)
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
    if index in SDO_CHANNELS:
        return True
    return index in (SYNC_COB_ID, SYNC_PERIOD, SYNC_OVERFLOW, TIME_COB_ID, EMCY_COB_ID) or (
        index == CONSUMER_TIMES and sub_index > 0
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
        if step.index == CONSUMER_TIMES:
            continue
        released = _released(step, wanted)
        if released is None:
            rest.append(step)
        elif released == step.after:
            early.append(step)
        else:
            first.append(step.otherwise(step.before, released, _RELEASED))
            rest.append(step.otherwise(released, step.after, step.reason))
    consumers = _consumers([step for step in wanted if step.index == CONSUMER_TIMES])
    stopped = sorted((*first, *early), key=lambda step: step.index != SYNC_COB_ID)
    return [*stopped, *sorted(rest, key=_rank), *consumers]


def altering(steps: Iterable[Step]) -> list[Step]:
    """Steps with an effect, and a SYNC period beside a changing overflow, since the period must be released."""
    wanted = list(steps)
    overflow = any(step.index == SYNC_OVERFLOW and step.before != step.after for step in wanted)
    return [step for step in wanted if step.before != step.after or (overflow and step.index == SYNC_PERIOD)]


def _released(step: Step, beside: Sequence[Step]) -> bytes | None:
    """Value for the object in *step* while other objects are written; None if it is not in the way."""
    if step.before is None:
        return None
    held, wanted = (int.from_bytes(data, "little") for data in (step.before, step.after))
    if step.index == SYNC_PERIOD:
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
    if step.index == SYNC_COB_ID:
        return held & ~_PRODUCES
    if step.index == TIME_COB_ID:
        return held & ~(_PRODUCES | _CONSUMES)
    if step.index == EMCY_COB_ID or (step.index in SDO_CHANNELS and step.sub_index in _SDO_COB_IDS):
        return held | _INVALID
    return None


def _rank(step: Step) -> int:
    """Sort key: the overflow before the period, the period before SYNC; an SDO channel's node before its COB-IDs."""
    if step.index == SYNC_COB_ID:
        return 2
    return 1 if step.index == SYNC_PERIOD or _stopped(step, 0) is not None else 0


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
