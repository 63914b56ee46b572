"""A node that produces SYNC: 0x1005 bit 30, 0x1006 and 0x1019 (CiA 301, 7.5.2.5, 7.5.2.6 and 7.5.2.22).

And COB-IDs of other services, frozen as that of SYNC is. Time is passed in. Does not know what a SYNC makes a node do.
"""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.memory import Memory
from dvtcli.simulator.device.refusal import Refusal

SYNC_COB_ID, SYNC_PERIOD, SYNC_OVERFLOW = 0x1005, 0x1006, 0x1019
_PRODUCES, _EXTENDED = 1 << 30, 1 << 29
_DEFAULT_CAN_ID = 0x80
_TIME_COB_ID, _EMCY_COB_ID, _SDO_CHANNELS = 0x1012, 0x1014, range(0x1201, 0x1300)
_INVALID, _TIME_USED, _FROZEN = 1 << 31, 3 << 30, 0x3FFF_FFFF


class SyncProducer:
    """The SYNC producer of one device; *due_s* is when its next SYNC is due, infinite for never."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Start over, as after a reset: the counter begins with 1."""
        self._period_us = 0
        self._counter = 0
        self.due_s = float("inf")

    def check(self, index: int, _sub_index: int, data: bytes) -> None:
        """Refuse a download to 0x1005 or 0x1019 that the standard forbids while SYNCs are produced."""
        if index == SYNC_OVERFLOW:
            self._check_overflow(data)
        elif index == SYNC_COB_ID:
            self._check_cob_id(data)

    def _check_overflow(self, data: bytes) -> None:
        """CiA 301, 7.5.2.22: not to be changed while the SYNC period is not 0."""
        if data != self._memory.read(SYNC_OVERFLOW, 0) and self._memory.number(SYNC_PERIOD, 0):
            raise Refusal(Abort.DEVICE_STATE)

    def _check_cob_id(self, data: bytes) -> None:
        """CiA 301, 7.5.2.5: bits 29 to 0 are not to be changed while the node produces SYNC (bit 30)."""
        held, wanted = self._memory.number(SYNC_COB_ID, 0), int.from_bytes(data, "little")
        if held & wanted & _PRODUCES and (held ^ wanted) & 0x3FFF_FFFF:
            raise Refusal(Abort.VALUE_RANGE)

    def poll(self, now_s: float) -> Frame | None:
        """The SYNC due at *now_s* (s); the first comes one period (0x1006, µs) after it was switched on."""
        raw = self._memory.number(SYNC_COB_ID, 0, missing=_DEFAULT_CAN_ID)
        period_us = self._memory.number(SYNC_PERIOD, 0) if raw & _PRODUCES else 0
        if period_us != self._period_us:
            self.reset()
            self._period_us = period_us
            self.due_s = now_s + period_us / 1e6 if period_us else float("inf")
        if now_s < self.due_s:
            return None
        late = now_s >= self.due_s + period_us / 1e6
        self.due_s = (now_s if late else self.due_s) + period_us / 1e6
        return Frame(raw & 0x1FFF_FFFF, self._count(), extended=bool(raw & _EXTENDED))

    def _count(self) -> bytes:
        """The counter byte, 1..0x1019; no byte where 0x1019 is 0 or absent."""
        overflow = self._memory.number(SYNC_OVERFLOW, 0)
        if not overflow:
            return b""
        self._counter = self._counter % overflow + 1
        return bytes([self._counter])


class ServiceCobIds:
    """COB-IDs of TIME, EMCY and further SDO channels of one device, frozen while the service uses them.

    Source: CiA 301, 7.5.2.15, 7.5.2.17, 7.5.2.33 and 7.5.2.34.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Refuse other bits 29 to 0 for a service that goes on using its COB-ID."""
        if index not in (_TIME_COB_ID, _EMCY_COB_ID) and not (index in _SDO_CHANNELS and sub_index in (1, 2)):
            return
        held, wanted = self._memory.number(index, sub_index), int.from_bytes(data, "little")
        if _is_used(index, held) and _is_used(index, wanted) and (held ^ wanted) & _FROZEN:
            raise Refusal(Abort.VALUE_RANGE)


def _is_used(index: int, raw: int) -> bool:
    return bool(raw & _TIME_USED) if index == _TIME_COB_ID else not raw & _INVALID
