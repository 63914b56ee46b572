"""Traffic received on a bus: each CAN-ID's last frame, and for a while frequencies, commands, node states. Pure."""

from __future__ import annotations

from collections import Counter, OrderedDict, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

from dvtcli.domain.can_ids import LSS_REQUEST_ID, NMT_ID
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.pdo import PDO_INDICES
from dvtcli.domain.ports import Frame

if TYPE_CHECKING:
    from dvtcli.domain.network.network_state import Identifier

_REQUEST_IDS = range(0x601, 0x680)
_EMERGENCIES = range(0x081, 0x100)
_HEARTBEATS = range(0x701, 0x780)
#: an expedited download of 0x1017, without the size bits
_EXPEDITED, _HEARTBEAT_TIME = 1, b"\x17\x10\x00"
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
        if can_id == NMT_ID and len(data) == 2:
            self._command(data)
        elif can_id == LSS_REQUEST_ID:
            self.lss += 1
        elif can_id in _REQUEST_IDS:
            self.requests[node_id] += 1
            if data[:1] and data[0] >> 5 == _EXPEDITED and data[1:4] == _HEARTBEAT_TIME:
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


#: Maximum number of remembered CAN-IDs; a new CAN-ID replaces the one silent for longest.
MOST_IDS = 512
#: command specifiers of SDO downloads: expedited and segmented, block
_ANY_DOWNLOADS = (1, 6)
_NEVER = float("-inf")


@dataclass(frozen=True, slots=True)
class Period:
    """Time between two frames of a CAN-ID in seconds: the last, the shortest and the longest."""

    last_s: float
    least_s: float
    most_s: float


@dataclass(frozen=True, slots=True)
class LatestFrame:
    """The last frame of a CAN-ID: its *data* and arrival time (s, of the clock given to `LastFrames.take`)."""

    data: bytes
    at_s: float
    #: None until a second frame came
    period: Period | None = None


class LastFrames:
    """Remembers the last data frame per CAN-ID, for at most `MOST_IDS` CAN-IDs."""

    def __init__(self) -> None:
        self._received: OrderedDict[tuple[int, bool], LatestFrame] = OrderedDict()
        #: time of the last write to a PDO parameter, by node-ID and index, and of the node's boot-up (index 0)
        self._set_s: dict[tuple[int, int], float] = {}

    def take(self, frame: Frame, now_s: float) -> None:
        """Remember *frame*, received at *now_s*; remote frames are ignored."""
        if frame.remote:
            return
        key = frame.can_id, frame.extended
        if not frame.extended and frame.data:
            self._note_setting(frame.can_id, frame.data, now_s)
        before = self._received.pop(key, None)
        self._received[key] = LatestFrame(frame.data, now_s, None if before is None else _period(before, now_s))
        if len(self._received) > MOST_IDS:
            self._received.popitem(last=False)

    def clear(self) -> None:
        """Forget all frames."""
        self._received.clear()
        self._set_s.clear()

    def _note_setting(self, can_id: int, data: bytes, now_s: float) -> None:
        """Note downloads and restarts that may change layout or COB-ID of a node's PDOs."""
        if can_id in _HEARTBEATS and data == b"\0":  # a boot-up
            self._set_s[can_id & 0x7F, 0] = now_s
        elif can_id in _REQUEST_IDS and data[0] >> 5 in _ANY_DOWNLOADS:
            index = int.from_bytes(data[1:3], "little")
            if index in PDO_INDICES:
                self._set_s[can_id & 0x7F, index] = now_s

    def set_s(self, node_id: int, indices: Iterable[int]) -> float:
        """Time when a PDO parameter among *indices* of *node_id* was last written, or the node booted."""
        return max(self._set_s.get((node_id, index), _NEVER) for index in (0, *indices))

    def last(self, can_id: int, *, extended: bool = False) -> LatestFrame | None:
        """The last frame with *can_id* (11 bits, 29 if *extended*), None if none was received."""
        return self._received.get((can_id, extended))


def _period(before: LatestFrame, now_s: float) -> Period:
    gap_s, known = now_s - before.at_s, before.period
    if known is None:
        return Period(gap_s, gap_s, gap_s)
    return Period(gap_s, min(known.least_s, gap_s), max(known.most_s, gap_s))
