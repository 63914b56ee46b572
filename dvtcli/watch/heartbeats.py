"""Due time of each node's heartbeat: by its 0x1017 if known, else by the last period. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.can_ids import HEARTBEAT_BASE
from dvtcli.domain.objects import PRODUCER_HEARTBEAT
from dvtcli.domain.ports import Frame
from dvtcli.watch.sdo_transfers import ReceivedObjects, is_boot_up

#: A heartbeat is missing after this many periods plus this time (s).
MISSING_AFTER_PERIODS, GRACE_S = 2, 0.5


@dataclass(slots=True)
class _Beat:
    """A node's last heartbeat and its period (s)."""

    last_s: float
    period_s: float | None = None


class Heartbeats:
    """Track all nodes' heartbeats, and all SDO transfers of 0x1017."""

    def __init__(self) -> None:
        self._beats: dict[int, _Beat] = {}
        self._times = HeartbeatTimes()
        #: a node's last known 0x1017 since its boot-up (s); 0: no heartbeat
        self._told_s: dict[int, float] = {}

    def take(self, frame: Frame, now_s: float) -> None:
        """Process *frame*, sent by anyone at *now_s*; called for every frame: must be quick."""
        if (received := self._times.take(frame)) is not None:
            self._note_time(received, now_s)
        elif is_boot_up(frame):
            self._beats.pop(frame.can_id & 0x7F, None)
            self._told_s.pop(frame.can_id & 0x7F, None)
        elif frame.can_id & ~0x7F == HEARTBEAT_BASE and len(frame.data) == 1 and not (frame.extended or frame.remote):
            node_id = frame.can_id & 0x7F
            known = self._beats.get(node_id)
            self._beats[node_id] = _Beat(now_s, None if known is None else now_s - known.last_s)

    def _note_time(self, received: ReceivedTime, now_s: float) -> None:
        self._told_s[received.node_id] = received.time_s
        if not received.time_s:
            self._beats.pop(received.node_id, None)
        elif (
            received.written and received.node_id in self._beats
        ):  # the next heartbeat comes a new period after the write
            self._beats[received.node_id].last_s = max(now_s, self._beats[received.node_id].last_s)

    @property
    def node_ids(self) -> tuple[int, ...]:
        """Nodes with heartbeats."""
        return tuple(self._beats)

    def silence_s(self, node_id: int, now_s: float) -> tuple[float, bool] | None:
        """Seconds since the last heartbeat, and whether the next is overdue; None for a node without heartbeat."""
        beat = self._beats.get(node_id)
        period_s = None if beat is None else self._told_s.get(node_id) or beat.period_s
        if beat is None or period_s is None:
            return None
        age_s = now_s - beat.last_s
        return age_s, age_s > MISSING_AFTER_PERIODS * period_s + GRACE_S


@dataclass(frozen=True, slots=True)
class ReceivedTime:
    """The value of a node's 0x1017 in seconds, and whether it was *written* or read."""

    node_id: int
    time_s: float
    written: bool


class HeartbeatTimes:
    """Track the SDO transfers of 0x1017 on the bus."""

    def __init__(self) -> None:
        self._objects = ReceivedObjects({PRODUCER_HEARTBEAT})

    def take(self, frame: Frame) -> ReceivedTime | None:
        """The heartbeat time if *frame* completes its transfer; None for every other frame."""
        received = self._objects.take(frame)
        if received is None:
            return None
        value = self._objects.values(received.node_id).values[received.place]
        return ReceivedTime(received.node_id, int.from_bytes(value[:2], "little") / 1000, received.is_written)
