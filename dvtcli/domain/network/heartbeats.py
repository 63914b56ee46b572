"""Consumer heartbeat times. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from dvtcli.domain.rules.finding import ERROR, NOTE, WARNING, Rule

RULES = (
    Rule("link-guarded", ERROR, "a heartbeat is to be sent by a node that is guarded (0x100C x 0x100D is not 0)",
         "CiA 301, 7.2.8.3.2: node guarding and heartbeat exclude each other"),
    Rule("link-no-heartbeat", ERROR, "a heartbeat is to be set on a node that has no 0x1017", "CiA 301, 7.5.2.18"),
    Rule("link-silent", NOTE, "the producer of a link sends no heartbeat, so that no node notices its loss",
         "CiA 301, 7.5.2.18"),
    Rule("link-unwatched", WARNING, "the consumer of a link cannot watch the producer's heartbeat",
         "CiA 301, 7.5.2.17"),
)  # fmt: skip

#: Consumer time in heartbeat periods: the default of `heartbeat_multiplier` in a network file.
CONSUMER_PERIODS = 3
LONGEST_MS = 0xFFFF


def watch_time_ms(producer_ms: int, multiplier: float = CONSUMER_PERIODS) -> int | None:
    """Consumer time in ms for a heartbeat sent every *producer_ms* (1..65535); None if no longer time is possible.

    The time is *multiplier* (1 and up) times the producer's.
    """
    time_ms = min(int(multiplier * producer_ms), LONGEST_MS)
    return time_ms if time_ms > producer_ms else None


def watched_ms(slots: Mapping[int, int], producer: int) -> int:
    """Consumer time in ms of the entries of 0x1016 in *slots*, by sub-index, for node *producer*; 0 for none.

    Source: CiA 301, 7.5.2.17: node-ID in bits 16..23, time in ms below.
    """
    return next((value & 0xFFFF for value in slots.values() if value >> 16 & 0xFF == producer and value & 0xFFFF), 0)


def slot_for(slots: Mapping[int, int], producer: int) -> int | None:
    """The sub-index of 0x1016 that watches node *producer*, else a free sub-index, else None.

    An entry is free if its node-ID or its time is 0 (CiA 301, 7.5.2.17).
    """
    used = {sub_index: value for sub_index, value in slots.items() if value & 0xFFFF and value >> 16 & 0xFF}
    own = (sub_index for sub_index, value in used.items() if value >> 16 & 0xFF == producer)
    return next(own, next((sub_index for sub_index in slots if sub_index not in used), None))
