"""The heartbeat configuration of a node: producer time, consumers, and node guarding. Writes nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_optional
from dvtcli.device.seen_state import HEARTBEAT_TIME

if TYPE_CHECKING:
    from dvtcli.domain.ports import SdoReader

_CONSUMER = 0x1016
_GUARD_TIME, _LIFE_TIME_FACTOR = 0x100C, 0x100D


def heartbeat_ms(sdo: SdoReader) -> int | None:
    """The producer heartbeat time in ms (0x1017); 0 for none, None without the object."""
    return read_optional(sdo, HEARTBEAT_TIME, 0, 2)


def heartbeat_slots(sdo: SdoReader) -> dict[int, int]:
    """The entries of the node's 0x1016 by sub-index; empty without the object."""
    count = read_optional(sdo, _CONSUMER, 0, 1) or 0
    held = {sub_index: read_optional(sdo, _CONSUMER, sub_index, 4) for sub_index in range(1, count + 1)}
    return {sub_index: value for sub_index, value in held.items() if value is not None}


def is_guarded(sdo: SdoReader) -> bool:
    """True if the node is guarded: its life time, 0x100C times 0x100D, is not 0 (CiA 301, 7.5.2.11 and 7.5.2.12)."""
    return bool((read_optional(sdo, _GUARD_TIME, 0, 2) or 0) * (read_optional(sdo, _LIFE_TIME_FACTOR, 0, 1) or 0))
