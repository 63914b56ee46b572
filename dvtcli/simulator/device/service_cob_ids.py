"""COB-IDs of TIME, EMCY and further SDO channels, which a device freezes while the service uses them.

CiA 301, 7.5.2.15, 7.5.2.17, 7.5.2.33 and 7.5.2.34. Does not know what the services send.
"""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.domain.value_order import EMCY_COB_ID, SDO_CHANNELS, TIME_COB_ID
from dvtcli.simulator.device.memory import Memory
from dvtcli.simulator.device.refusal import Refusal

_INVALID, _TIME_USED, _FROZEN = 1 << 31, 3 << 30, 0x3FFF_FFFF


class ServiceCobIds:
    """Those of one device."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Refuse other bits 29 to 0 for a service that goes on using its COB-ID."""
        if not (index in (TIME_COB_ID, EMCY_COB_ID) or (index in SDO_CHANNELS and sub_index in (1, 2))):
            return
        held, wanted = self._memory.number(index, sub_index), int.from_bytes(data, "little")
        if _is_used(index, held) and _is_used(index, wanted) and (held ^ wanted) & _FROZEN:
            raise Refusal(Abort.VALUE_RANGE)


def _is_used(index: int, raw: int) -> bool:
    return bool(raw & _TIME_USED) if index == TIME_COB_ID else not raw & _INVALID
