"""The heartbeat of a simulated node: 0x1017 (CiA 301, 7.2.8.3.2).

Time is passed in. Does not know what an NMT state means.
"""

from __future__ import annotations

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.memory import Memory

HEARTBEAT_TIME = 0x1017
HEARTBEAT = 0x700


class Heartbeat:
    """The heartbeat producer of one device; *due_s* is when its next one is due, infinite for never."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Start over, as after a boot-up: the first heartbeat comes at once."""
        self._period_ms = 0
        self.due_s = float("inf")

    def poll(self, now_s: float, state: NmtState) -> list[Frame]:
        """The heartbeat due at *now_s* (s), which tells *state*."""
        period_ms = self._memory.number(HEARTBEAT_TIME, 0)
        if period_ms != self._period_ms:
            self._period_ms, self.due_s = period_ms, now_s if period_ms else float("inf")
        if now_s < self.due_s:
            return []
        period_s = period_ms / 1000
        late = now_s >= self.due_s + period_s
        self.due_s = (now_s if late else self.due_s) + period_s
        return [Frame(HEARTBEAT + self._memory.node_id, bytes([state]))]
