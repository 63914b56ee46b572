"""Write order of interdependent values: SYNC, heartbeat consumer, and COB-IDs of services. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol, Self, TypeVar


class Download(Protocol):
    """A step of a plan."""

    @property
    def index(self) -> int:
        """The object's index."""

    @property
    def sub_index(self) -> int:
        """The sub-index."""

    @property
    def before(self) -> bytes | None:
        """The present value; None if unknown."""

    @property
    def after(self) -> bytes:
        """The new value."""

    @property
    def reason(self) -> str:
        """The reason for the write."""

    def otherwise(self, before: bytes | None, after: bytes, reason: str) -> Self:
        """The same object, from *before* to *after*."""


Step = TypeVar("Step", bound=Download)

SYNC_COB_ID, SYNC_PERIOD, SYNC_OVERFLOW = 0x1005, 0x1006, 0x1019
TIME_COB_ID, EMCY_COB_ID, CONSUMER_TIMES = 0x1012, 0x1014, 0x1016
#: SDO server and client parameters (CiA 301, 7.5.2.33 and 7.5.2.34), except the read-only default channel
SDO_CHANNELS = range(0x1201, 0x1300)
_SDO_COB_IDS = (1, 2)
_INVALID, _PRODUCES, _CONSUMES = 1 << 31, 1 << 30, 1 << 31
#: bits 29 to 0 of a COB-ID: frozen while its service uses it
_FROZEN = 0x3FFF_FFFF


def is_dependent(index: int, sub_index: int) -> bool:
    """Whether an object's value must be written in an order with others, or by way of another value."""
    if index in SDO_CHANNELS:
        return True
    return index in (SYNC_COB_ID, SYNC_PERIOD, SYNC_OVERFLOW, TIME_COB_ID, EMCY_COB_ID) or (
        index == CONSUMER_TIMES and sub_index > 0
    )


def in_order(steps: Iterable[Step]) -> list[Step]:
    """Downloads that bring the objects in *steps*, one step each, to their new values in an order CiA 301 allows.

    Obstructive old values are released first: a service stops before its CAN-ID changes (7.5.2.5,
    7.5.2.15, 7.5.2.17, 7.5.2.33), the SYNC period is 0 while the counter's overflow changes (7.5.2.22), and of two
    consumer heartbeat times for one node the old time goes first (7.5.2.19). SYNC is produced once its period is set.
    Without releases each step is one download. The order also holds backwards.
    """
    wanted = list(steps)
    released = [(step, _released(step, wanted)) for step in wanted if step.index != CONSUMER_TIMES]
    first = [
        step.otherwise(step.before, data, _RELEASED)
        for step, data in released
        if data is not None and data != step.after
    ]
    early = [step for step, data in released if data == step.after]
    begun = {(step.index, step.sub_index): step.after for step in first}
    rest = [
        step.otherwise(begun.get((step.index, step.sub_index), step.before), step.after, step.reason)
        for step, data in released
        if data is None or data != step.after
    ]
    consumers = _consumers([step for step in wanted if step.index == CONSUMER_TIMES])
    stopped = sorted((*first, *early), key=lambda step: step.index != SYNC_COB_ID)
    return [*stopped, *sorted(rest, key=_rank), *consumers]


def altering(steps: Iterable[Step]) -> list[Step]:
    """Steps with an effect, and a SYNC period beside a changing overflow, since the period must be released."""
    wanted = list(steps)
    overflow = any(step.index == SYNC_OVERFLOW and step.before != step.after for step in wanted)
    return [step for step in wanted if step.before != step.after or (overflow and step.index == SYNC_PERIOD)]


_RELEASED = "release it: it is frozen or blocked"


def _released(step: Download, beside: Sequence[Download]) -> bytes | None:
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


def _stopped(step: Download, held: int) -> int | None:
    """The COB-ID *held* with its service disabled; None for any other object."""
    if step.index == SYNC_COB_ID:
        return held & ~_PRODUCES
    if step.index == TIME_COB_ID:
        return held & ~(_PRODUCES | _CONSUMES)
    if step.index == EMCY_COB_ID or (step.index in SDO_CHANNELS and step.sub_index in _SDO_COB_IDS):
        return held | _INVALID
    return None


def _rank(step: Download) -> int:
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


def _is_in_the_way(other: Download, step: Download) -> bool:
    """Whether *other* still waits for the new node of *step*."""
    node_id = _watched(step.after)
    return node_id is not None and node_id == _watched(other.before)


def _watched(data: bytes | None) -> int | None:
    """The node-ID of an entry in use: its time is not 0 (CiA 301, 7.5.2.19)."""
    raw = int.from_bytes(data or b"", "little")
    return raw >> 16 & 0xFF if raw & 0xFFFF else None
