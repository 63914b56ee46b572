"""Error control of a simulated node: heartbeats (0x1017, 0x1016; CiA 301, 7.2.8.3.2) and node guarding (0x100C).

The caller passes the time in; `strict_device` acts on the loss of a producer.
"""

from __future__ import annotations

from dvtcli.domain.abort import Abort
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.emergency import Emergencies
from dvtcli.simulator.device.memory import Memory, Refusal

CONSUMER_TIMES, HEARTBEAT_TIME = 0x1016, 0x1017
GUARD_TIME, LIFE_TIME_FACTOR = 0x100C, 0x100D
HEARTBEAT = 0x700
#: the EMCY error code of a producer that is not heard any more (CiA 301, table 26)
PRODUCER_LOST = 0x8130
_NEVER = float("inf")


class Heartbeat:
    """The heartbeat producer of one device; *due_s* is the time of the next heartbeat, infinite for never."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Restart as after a boot-up: the first heartbeat comes at once."""
        self._period_ms = 0
        self.due_s = _NEVER

    def poll(self, now_s: float, state: NmtState) -> list[Frame]:
        """The heartbeat due at *now_s* (s), with *state*."""
        period_ms = self._memory.number(HEARTBEAT_TIME, 0)
        if period_ms != self._period_ms:
            self._period_ms, self.due_s = period_ms, now_s if period_ms else _NEVER
        if now_s < self.due_s:
            return []
        period_s = period_ms / 1000
        late = now_s >= self.due_s + period_s
        self.due_s = (now_s if late else self.due_s) + period_s
        return [Frame(HEARTBEAT + self._memory.node_id, bytes([state]))]


class GuardingResponse:
    """The node guarding response: the state, on a remote frame (CiA 301, 7.2.8.3.2.1).

    For a device with a guard time (0x100C) and without heartbeats; there is no life guarding.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Restart as after a boot-up: the first answer's toggle bit is 0."""
        self._toggle = 0

    def concerns(self, frame: Frame) -> bool:
        """True if *frame* requests the device's state."""
        return frame.remote and not frame.extended and frame.can_id == HEARTBEAT + self._memory.node_id

    def listens(self, frame: Frame) -> bool:
        """True if *frame* requests the device's state, and the device answers."""
        if not self.concerns(frame):
            return False
        return self._memory.exists(GUARD_TIME, 0) and not self._memory.number(HEARTBEAT_TIME, 0)

    def answer(self, state: NmtState) -> Frame:
        """The device's answer in *state*; the next answer has the other toggle bit."""
        toggle, self._toggle = self._toggle, self._toggle ^ 0x80
        return Frame(HEARTBEAT + self._memory.node_id, bytes([toggle | state]))


class HeartbeatConsumer:
    """The heartbeat consumer of one device; a producer is monitored from its first heartbeat on.

    *due_s* is the time of the next loss, infinite for never; *changes* grows whenever the result of `listens` may
    change.
    """

    def __init__(self, memory: Memory, errors: Emergencies) -> None:
        self._memory = memory
        self._errors = errors
        self.changes = 0
        self.configure()

    def configure(self) -> None:
        """Reload 0x1016 and wait for every producer again."""
        self.changes += 1
        entries = [] if self._memory.backing is not None else list(self._entries().values())
        self._times_s = {raw >> 16: (raw & 0xFFFF) / 1000 for raw in entries if raw & 0xFFFF and 1 <= raw >> 16 <= 127}
        self._received: set[int] = set()
        self._until_s: dict[int, float] = {}
        self.due_s = _NEVER

    def check(self, index: int, sub_index: int, data: bytes) -> None:
        """Refuse a second time for one producer (CiA 301, 7.5.2.16), and node guarding beside heartbeats."""
        wanted = int.from_bytes(data, "little")
        if index in (GUARD_TIME, LIFE_TIME_FACTOR) and wanted and self._memory.backing is None:
            raise Refusal(Abort.VALUE_RANGE)
        if index != CONSUMER_TIMES or not sub_index or not wanted & 0xFFFF:
            return
        others = (raw for sub, raw in self._entries().items() if sub != sub_index)
        if any(raw & 0xFFFF and (raw ^ wanted) >> 16 & 0xFF == 0 for raw in others):
            raise Refusal(Abort.INCOMPATIBLE)

    def listens(self, frame: Frame) -> bool:
        """True if *frame* is a heartbeat of a monitored producer."""
        return frame.can_id - HEARTBEAT in self._times_s and not frame.extended and not frame.remote

    def hear(self, frame: Frame) -> list[Frame]:
        """Receive a heartbeat; the EMCY frames: none, or the end of an error."""
        producer = frame.can_id - HEARTBEAT
        self._received.add(producer)
        self._memory.touch()
        return self._errors.clear((CONSUMER_TIMES, producer))

    def poll(self, now_s: float) -> list[Frame] | None:
        """The EMCY frames for producers lost by *now_s* (s), None without a loss."""
        for producer in self._received:
            self._until_s[producer] = now_s + self._times_s[producer]
        self._received.clear()
        lost = [producer for producer, until_s in self._until_s.items() if until_s <= now_s]
        frames: list[Frame] = []
        for producer in lost:
            del self._until_s[producer]
            frames += self._errors.set((CONSUMER_TIMES, producer), PRODUCER_LOST)
        self.due_s = min(self._until_s.values(), default=_NEVER)
        return frames if lost else None

    def _entries(self) -> dict[int, int]:
        last = self._memory.highest_sub_index(CONSUMER_TIMES) or 0
        return {sub: self._memory.number(CONSUMER_TIMES, sub) for sub in range(1, last + 1)}
