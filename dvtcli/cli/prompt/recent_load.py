"""How busy the bus is: the bits of the last second against the bit rate. Does not know where frames come from."""

from __future__ import annotations

from collections import deque

from dvtcli.domain.bus_load import frame_bits
from dvtcli.domain.ports import Frame

#: The time that is looked back at (s), and the slots that it is counted in.
WINDOW_S, SLOTS = 1.0, 10


class BusLoad:
    """The load of a bus of *bitrate* bit/s; frames and questions may come from two threads."""

    def __init__(self, bitrate: int) -> None:
        self._bitrate = bitrate
        #: bits by slot of time, the newest last: (number of the slot, bits)
        self._slots: deque[tuple[int, int]] = deque(maxlen=SLOTS + 1)

    def add(self, frame: Frame, now_s: float) -> None:
        """Count a *frame* that was seen at *now_s*."""
        slot, bits = int(now_s * SLOTS / WINDOW_S), frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)
        if self._slots and self._slots[-1][0] == slot:
            self._slots[-1] = slot, self._slots[-1][1] + bits
        else:
            self._slots.append((slot, bits))

    def share(self, now_s: float) -> float:
        """The share of the bit rate, 0..1, that the frames of the last whole slots took."""
        now = int(now_s * SLOTS / WINDOW_S)
        bits = sum(bits for slot, bits in tuple(self._slots) if now - SLOTS <= slot < now)
        return bits / (self._bitrate * WINDOW_S)
