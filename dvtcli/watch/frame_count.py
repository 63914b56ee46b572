"""Count frames and their bits: the real bus load. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.bus_load import frame_bits
from dvtcli.domain.ports import Frame

#: A CAN-ID, and whether it has 29 bits.
Identifier = tuple[int, bool]


@dataclass(slots=True)
class Counted:
    """Frames of a CAN-ID: number, *bits* with real stuff bits, and the times between frames.

    *data_bytes* is the length of the longest frame, *shortest_s* and *longest_s* are between two consecutive frames,
    None if fewer than two had a time.
    """

    frames: int = 0
    bits: int = 0
    data_bytes: int = 0
    shortest_s: float | None = None
    longest_s: float | None = None
    _last_s: float = 0.0

    def add(self, frame: Frame) -> None:
        """Count *frame*."""
        self.frames += 1
        self.bits += frame_bits(frame.can_id, frame.data, frame.extended, frame.remote)
        self.data_bytes = max(self.data_bytes, len(frame.data))
        if not frame.timestamp_s:
            return  # sent from here: its time on the wire is unknown
        if self._last_s:
            gap_s = frame.timestamp_s - self._last_s
            self.shortest_s = gap_s if self.shortest_s is None else min(self.shortest_s, gap_s)
            self.longest_s = gap_s if self.longest_s is None else max(self.longest_s, gap_s)
        self._last_s = frame.timestamp_s


@dataclass(slots=True)
class FrameCount:
    """Frames by CAN-ID."""

    by_id: dict[Identifier, Counted] = field(default_factory=dict)

    def add(self, frame: Frame) -> None:
        """Count *frame*."""
        self.by_id.setdefault((frame.can_id, frame.extended), Counted()).add(frame)

    @property
    def frames(self) -> int:
        """Total number of frames."""
        return sum(count.frames for count in self.by_id.values())

    @property
    def bits(self) -> int:
        """How many bits they took in all."""
        return sum(count.bits for count in self.by_id.values())
