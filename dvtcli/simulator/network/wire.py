"""Time on a CAN wire: arrival times and arbitration of classical CAN (ISO 11898-1).

`domain.bus_load` has the length of a frame; times are seconds on a clock of the caller.
"""

from __future__ import annotations

from collections import deque
from heapq import heappop, heappush

from dvtcli.domain.bus_load import arbitration, frame_bits
from dvtcli.domain.ports import Frame

#: frames of one source, or of all where they take no time, that wait before the wire is full
_MOST_OF_ONE, _MOST_OF_ALL = 512, 10_000


class Wire:
    """A bus of *bitrate* bit/s with one frame at a time; without a bit rate frames take no time.

    Each *source* sends its frames in order; among waiting sources the lowest CAN-ID wins. Without a bit rate frames
    travel in the order of `offer`.
    """

    def __init__(self, bitrate: int | None = None) -> None:
        self._bit_s = 0.0 if bitrate is None else 1 / bitrate
        self._waiting: dict[object, deque[tuple[float, Frame]]] = {}
        #: the first waiting frame of each source: (time, order, source) if due after the last check of the
        #: wire, else (priority, order, source)
        self._later: list[tuple[float, int, object]] = []
        self._ready: list[tuple[int, int, object]] = []
        self._heads = 0
        self._straight: deque[tuple[float, object, Frame]] = deque()
        self._free_s = 0.0
        self._travelling: tuple[float, object, Frame] | None = None

    def offer(self, source: object, frame: Frame, at_s: float) -> None:
        """Queue *frame* of *source*, ready to be sent from *at_s* on."""
        if not self._bit_s:
            self._straight.append((at_s, source, frame))
        elif source in self._waiting:
            self._waiting[source].append((at_s, frame))
        else:
            self._waiting[source] = deque([(at_s, frame)])
            self._is_head(source)

    def waiting(self, source: object) -> int:
        """The number of frames of *source* (of all without a bit rate) that have not begun to travel."""
        if not self._bit_s:
            return len(self._straight)
        queue = self._waiting.get(source)
        return 0 if queue is None else len(queue)

    def full(self, source: object) -> bool:
        """True if the queue of node *source* is full and its further frames are lost."""
        return self.waiting(source) >= (_MOST_OF_ONE if self._bit_s else _MOST_OF_ALL)

    def take(self, now_s: float) -> tuple[float, object, Frame] | None:
        """The next frame complete by *now_s*, with the time of its last bit and its source; None for none."""
        if self._straight:
            return self._straight.popleft()
        self._begin(now_s)
        if self._travelling is None or self._travelling[0] > now_s:
            return None
        arrived, self._travelling = self._travelling, None
        return arrived

    def next_s(self) -> float | None:
        """The time of the next result of `take`; None without a frame."""
        if self._straight:
            return 0.0
        if self._travelling is not None:
            return self._travelling[0]
        return self._start_s()

    def _start_s(self) -> float | None:
        """The start time of the next frame, None without a waiting frame."""
        if self._ready:
            return self._free_s
        return max(self._free_s, self._later[0][0]) if self._later else None

    def _is_head(self, source: object) -> None:
        """Enter the first frame of *source* into arbitration from its time on."""
        self._heads += 1
        heappush(self._later, (self._waiting[source][0][0], self._heads, source))

    def _begin(self, now_s: float) -> None:
        """Start the winner of the arbitration, unless later than *now_s*."""
        start_s = None if self._travelling is not None else self._start_s()
        if start_s is None or start_s > now_s:
            return
        while self._later and self._later[0][0] <= start_s:
            _, order, source = heappop(self._later)
            heappush(self._ready, (_priority(self._waiting[source][0][1]), order, source))
        winner = heappop(self._ready)[2]
        _, frame = self._waiting[winner].popleft()
        if self._waiting[winner]:
            self._is_head(winner)
        else:
            del self._waiting[winner]
        self._free_s = start_s + frame_bits(frame.can_id, frame.data, frame.extended, frame.remote) * self._bit_s
        self._travelling = (self._free_s, winner, frame)


def _priority(frame: Frame) -> int:
    return arbitration(frame.can_id, extended=frame.extended, remote=frame.remote)
