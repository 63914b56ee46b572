"""The last frame of each CAN-ID received on a bus, and its period."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass

from dvtcli.domain.pdo import PDO_INDICES
from dvtcli.domain.ports import Frame

#: Maximum number of remembered CAN-IDs; a new CAN-ID replaces the one silent for longest.
MOST = 512
#: CAN-IDs of SDO requests and heartbeats; a heartbeat with data 0 is a boot-up
_REQUESTS, _HEARTBEATS = range(0x601, 0x680), range(0x701, 0x780)
#: command specifiers of SDO downloads: expedited and segmented, block
_DOWNLOADS = (1, 6)
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
    """Remembers the last data frame per CAN-ID, for at most `MOST` CAN-IDs."""

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
        if len(self._received) > MOST:
            self._received.popitem(last=False)

    def clear(self) -> None:
        """Forget all frames."""
        self._received.clear()
        self._set_s.clear()

    def _note_setting(self, can_id: int, data: bytes, now_s: float) -> None:
        """Note downloads and restarts that may change layout or COB-ID of a node's PDOs."""
        if can_id in _HEARTBEATS and data == b"\0":
            self._set_s[can_id & 0x7F, 0] = now_s
        elif can_id in _REQUESTS and data[0] >> 5 in _DOWNLOADS:
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
