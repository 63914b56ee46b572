"""How busy the bus is: frames and bits of the last second. Does not know where frames come from."""

from __future__ import annotations

from collections import deque

from dvtcli.domain.bus_load import frame_bits
from dvtcli.domain.ports import Frame

#: The time that is looked back at (s), and the slots that it is counted in.
WINDOW_S, SLOTS = 1.0, 10
#: A load (0..1) above which messages of low priority wait long.
HIGH_LOAD = 0.7


class BusLoad:
    """The load of a bus of *bitrate* bit/s (None: not known); frames and questions may come from two threads."""

    def __init__(self, bitrate: int | None) -> None:
        self._bitrate = bitrate
        #: by slot of time, the newest last: (number of the slot, frames, bits)
        self._slots: deque[tuple[int, int, int]] = deque(maxlen=SLOTS + 1)

    def add(self, frame: Frame, now_s: float) -> None:
        """Count a *frame* that was seen at *now_s*."""
        slot = int(now_s * SLOTS / WINDOW_S)
        bits = 0 if self._bitrate is None else frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)
        if self._slots and self._slots[-1][0] == slot:
            _, frames, before = self._slots[-1]
            self._slots[-1] = slot, frames + 1, before + bits
        else:
            self._slots.append((slot, 1, bits))

    def share(self, now_s: float) -> float | None:
        """The share of the bit rate, 0..1, that the frames of the last whole slots took; None where it is not known."""
        if self._bitrate is None:
            return None
        return sum(bits for _, bits in self._lately(now_s)) / (self._bitrate * WINDOW_S)

    def frames_a_second(self, now_s: float) -> float:
        """The frames of the last whole slots."""
        return sum(frames for frames, _ in self._lately(now_s)) / WINDOW_S

    def _lately(self, now_s: float) -> list[tuple[int, int]]:
        now = int(now_s * SLOTS / WINDOW_S)
        return [(frames, bits) for slot, frames, bits in tuple(self._slots) if now - SLOTS <= slot < now]
