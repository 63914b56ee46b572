"""Recurring frames of a network, with assumptions and what-if values."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction

from dvtcli.domain.network.response_time import TimedFrame
from dvtcli.domain.network.wanted_state import Endpoint
from dvtcli.domain.pdo import Pdo

Time = Fraction | int
SYNCHRONOUS = range(241)
ON_RTR = (252, 253)
EVENT_DRIVEN = (254, 255)
#: Assumed periods of a node's EMCY, and of the time stamp (µs).
EMCY_US, TIME_US = 1_000_000, 1_000_000
NO_LIMIT, NO_SYNC = "any event", "unknown SYNC"


@dataclass(frozen=True, slots=True)
class Stream:
    """A recurring frame: *kind* is `tpdo`, `rpdo`, `sync`, `heartbeat`, `guarding`, `emcy` or `time`.

    *label* names it, *node* is its sender. *why* explains its period, or why it has none. *deadline_us* counts from the
    planned transmission; *window_us* from SYNC, if the device has a window (0x1007). *assumed*: the period is an
    assumption.
    """

    kind: str
    label: str
    frame: TimedFrame
    why: str
    node: int | None = None
    pdo: Pdo | None = None
    deadline_us: Time | None = None
    window_us: int | None = None
    assumed: bool = False

    @property
    def is_synchronous(self) -> bool:
        """Whether SYNC triggers the frame."""
        return self.kind in ("tpdo", "rpdo") and self.why.startswith("SYNC")

    def late(self, jitter_us: Time) -> Stream:
        """The same stream, handed over up to *jitter_us* late."""
        deadline = self.deadline_us if self.window_us is None else self.window_us + jitter_us
        return replace(self, frame=replace(self.frame, jitter_us=jitter_us), deadline_us=deadline)


@dataclass(frozen=True, slots=True)
class WhatIf:
    """What-if values that replace the network's: *sync_us* and *emcy_us* (µs), inhibit times in 100 µs."""

    sync_us: int | None = None
    emcy_us: int | None = None
    inhibit: dict[Endpoint, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Streams:
    """All streams, and the assumptions (*assumed*), each a sentence."""

    streams: tuple[Stream, ...]
    assumed: tuple[str, ...]


def in_ms(time_us: Time) -> str:
    """A time in text form: `2.5 ms`."""
    return f"{float(Fraction(time_us) / 1000):g} ms"
