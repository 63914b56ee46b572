"""When one TPDO is sent: by SYNC, on change, by event timer, on a remote frame (CiA 301, 7.2.2.2 and 7.5.2.37).

Time is passed in, in seconds of a monotonic clock. Does not know objects nor frames: it is asked with the bytes that
the TPDO would carry.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dvtcli.domain.mapping import PdoMappingEntry

LAST_SYNCHRONOUS = 240
_SYNC_RTR, _FIRST_EVENT_DRIVEN = 252, 254
NEVER = float("inf")


@dataclass(slots=True)
class EventTiming:
    """An event-driven TPDO's times in seconds, 0 for none: least between two frames, most between two frames.

    The first frame is due at once: consumers learn the values when the node starts.
    """

    inhibit_s: float
    event_s: float
    sent: bytes | None = None
    inhibited_until_s: float = -NEVER
    event_due_s: float = NEVER
    #: when the next frame may be due without a change of the data
    due_s: float = -NEVER

    def is_due(self, data: bytes, now_s: float) -> bool:
        """Whether a frame with *data* goes out at *now_s*; it then counts as sent."""
        wanted = data != self.sent or now_s >= self.event_due_s
        if wanted and now_s >= self.inhibited_until_s:
            self._note(data, now_s)
            return True
        self.due_s = self.inhibited_until_s if wanted else max(self.event_due_s, self.inhibited_until_s)
        return False

    def _note(self, data: bytes, now_s: float) -> None:
        """The event timer runs from its own beat while it is punctual, else from now; a change starts it again."""
        on_time = data == self.sent and now_s < self.event_due_s + self.event_s
        self.sent = data
        self.inhibited_until_s = now_s + self.inhibit_s if self.inhibit_s else -NEVER
        if self.event_s:
            self.event_due_s = (self.event_due_s if on_time else now_s) + self.event_s
        self.due_s = max(self.event_due_s, self.inhibited_until_s)


@dataclass(slots=True)
class Tpdo:
    """One enabled TPDO: what it is set to, and where it stands since it was enabled or the node was started.

    *kind* is the transmission type, *start* the SYNC start value (0: none), *entries* the mapping in frame order.
    """

    can_id: int
    extended: bool
    rtr_allowed: bool
    kind: int
    start: int
    entries: tuple[PdoMappingEntry, ...]
    #: None until it is polled for the first time, or for ever where it is not event-driven
    timing: EventTiming | None = None
    #: what was last sent by type 0, or sampled by type 252
    sample: bytes | None = field(default=None, repr=False)
    _seen: int = 0
    _started: bool = False

    @property
    def heeds_sync(self) -> bool:
        """Whether a SYNC means something to it."""
        return self.kind <= LAST_SYNCHRONOUS or self.kind == _SYNC_RTR

    @property
    def event_driven(self) -> bool:
        """Whether it is sent on change and by its event timer."""
        return self.kind >= _FIRST_EVENT_DRIVEN

    def is_due_at_sync(self, data: bytes, counter: int | None) -> bool:
        """Whether a frame with *data* goes out at this SYNC, the *counter* of which is 1..240 or not there."""
        if self.kind == _SYNC_RTR:
            self.sample = data
            return False
        if self.kind == 0:
            changed, self.sample = data != self.sample, data
            return changed
        if counter is not None and self.start and not self._started:
            self._started = counter == self.start
            return self._started
        self._seen = (self._seen + 1) % self.kind
        return self._seen == 0

    def requested(self, data: bytes) -> bytes | None:
        """What it carries when a remote frame asks for it; None for nothing sampled yet, or no remote frames."""
        if not self.rtr_allowed:
            return None
        return self.sample if self.kind == _SYNC_RTR else data
