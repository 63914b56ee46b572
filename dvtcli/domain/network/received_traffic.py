"""Traffic received on a bus for a while: frequency of each CAN-ID, commands, node states. Pure."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from itertools import pairwise

from dvtcli.domain.network.network_state import Identifier
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame

_NMT, _LSS = 0x000, 0x7E5
_REQUESTS = range(0x601, 0x680)
_EMERGENCIES = range(0x081, 0x100)
_HEARTBEATS = range(0x701, 0x780)
#: an expedited download of 0x1017, without the size bits
_DOWNLOADS, _HEARTBEAT_TIME = 1, b"\x17\x10\x00"
#: Number of remembered times per CAN-ID.
_MOST_TIMES = 1000


@dataclass(slots=True)
class ReceivedId:
    """Frames of a CAN-ID: count, lengths, and the first times (s) and contents."""

    frames: int = 0
    lengths: set[int] = field(default_factory=set)
    times_s: list[float] = field(default_factory=list)
    first_bytes: list[int | None] = field(default_factory=list)

    @property
    def gaps_s(self) -> list[float]:
        """Gaps between the frames in seconds; empty if the bus gives no times."""
        return [after - before for before, after in pairwise(self.times_s)]


@dataclass(slots=True)
class ReceivedTraffic:
    """Frames of other nodes within *seconds*, and the number of error frames."""

    seconds: float = 0.0
    error_frames: int = 0
    frames: int = 0
    by_id: defaultdict[Identifier, ReceivedId] = field(default_factory=lambda: defaultdict(ReceivedId))
    #: SDO requests by server node
    requests: Counter[int] = field(default_factory=Counter)
    #: nodes whose 0x1017 was written meanwhile: some heartbeats still had the old period
    heartbeat_written: set[int] = field(default_factory=set)
    #: NMT commands in words, and the number of LSS commands
    commands: Counter[str] = field(default_factory=Counter)
    lss: int = 0
    #: states in each node's heartbeats, in order, without repeats
    states: defaultdict[int, list[NmtState]] = field(default_factory=lambda: defaultdict(list))
    boot_ups: Counter[int] = field(default_factory=Counter)
    #: error codes of EMCY messages by node
    emergencies: defaultdict[int, Counter[int]] = field(default_factory=lambda: defaultdict(Counter))

    def add(self, frame: Frame) -> None:
        """Count *frame*."""
        self.frames += 1
        if frame.remote:
            return
        received = self.by_id[frame.can_id, frame.extended]
        received.frames += 1
        received.lengths.add(len(frame.data))
        if frame.timestamp_s and len(received.times_s) < _MOST_TIMES:
            received.times_s.append(frame.timestamp_s)
            received.first_bytes.append(frame.data[0] if frame.data else None)
        if not frame.extended:
            self._of_service(frame)

    def _of_service(self, frame: Frame) -> None:
        can_id, node_id, data = frame.can_id, frame.can_id & 0x7F, frame.data
        if can_id == _NMT and len(data) == 2:
            self._command(data)
        elif can_id == _LSS:
            self.lss += 1
        elif can_id in _REQUESTS:
            self.requests[node_id] += 1
            if data[:1] and data[0] >> 5 == _DOWNLOADS and data[1:4] == _HEARTBEAT_TIME:
                self.heartbeat_written.add(node_id)
        elif can_id in _EMERGENCIES and len(data) >= 2:
            self.emergencies[node_id][int.from_bytes(data[:2], "little")] += 1
        elif can_id in _HEARTBEATS and len(data) == 1:
            self._heartbeat(node_id, data[0] & 0x7F)

    def _command(self, data: bytes) -> None:
        known = data[0] in set(NmtCommand)
        what = f"nmt {NmtCommand(data[0]).word}" if known else f"NMT command 0x{data[0]:02X}"
        self.commands[f"{what} {'all' if data[1] == 0 else data[1]}"] += 1

    def _heartbeat(self, node_id: int, state: int) -> None:
        if state not in set(NmtState):
            return
        self.boot_ups[node_id] += state == NmtState.INITIALISING
        if self.states[node_id][-1:] != [state]:
            self.states[node_id].append(NmtState(state))

    def count(self, identifier: Identifier) -> int:
        """Number of frames of a CAN-ID."""
        received = self.by_id.get(identifier)
        return 0 if received is None else received.frames

    def rate_hz(self, identifier: Identifier) -> float:
        """Frames a second of a CAN-ID."""
        return self.count(identifier) / self.seconds if self.seconds else 0.0
