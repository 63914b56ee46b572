"""Distribution of frames to receivers and observers, and the last exchanges."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from queue import SimpleQueue
from time import time
from typing import Generic, TypeVar
from weakref import ref

from dvtcli.bus.receiver import Wake
from dvtcli.domain.ports import Frame

#: frames received after a sent frame are kept for a `receive` within this time (s)
ANSWERS_KEPT_S = 1.0
#: number of remembered frames: sent frames and their answers
REMEMBERED = 1024

Tap = Callable[[Frame, bool], None]
M = TypeVar("M")


class Traffic(Generic[M]):
    """Passes messages on as frames to all receivers; *now_s* returns the bus's time in seconds."""

    def __init__(self, frame_of: Callable[[M], Frame], now_s: Callable[[], float]) -> None:
        self._frame_of = frame_of
        self._now_s = now_s
        self._listeners: list[ref[SimpleQueue[Frame | Wake]]] = []
        self._taps: list[Tap] = []
        self._answers: deque[M] = deque(maxlen=4096)
        self._kept_until_s: float | None = None
        #: the last exchanges: message, whether it is ours, and time (s since 1970)
        self._exchanged: deque[tuple[M, bool, float]] = deque(maxlen=REMEMBERED)

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame; returns a function that ends it."""
        self._taps.append(callback)
        return lambda: self._taps.remove(callback)

    def keep_answers(self) -> None:
        """Keep received frames for the next `listen` from now on: an answer may come before it."""
        self._answers.clear()
        self._kept_until_s = self._now_s() + ANSWERS_KEPT_S

    def listen(self) -> SimpleQueue[Frame | Wake]:
        """A queue that gets kept frames and all later frames, as long as it is referenced."""
        inbox: SimpleQueue[Frame | Wake] = SimpleQueue()
        if self._kept_until_s is not None and self._now_s() < self._kept_until_s:
            for message in tuple(self._answers):
                inbox.put(self._frame_of(message))
        self._kept_until_s = None
        self._listeners.append(ref(inbox, self._listeners.remove))
        return inbox

    def received(self, message: M) -> None:
        """Pass on a message from the bus."""
        if self._kept_until_s is not None:
            self._answers.append(message)
        if self._taps or self._listeners:
            frame = self._frame_of(message)
            for listener in tuple(self._listeners):
                inbox = listener()
                if inbox is not None:
                    inbox.put(frame)
            self._tell_taps(frame, False)

    def sent(self, message: M) -> None:
        """Distribute a sent message."""
        self._exchanged.append((message, True, time()))
        if self._taps:
            self._tell_taps(self._frame_of(message), True)

    def answered(self, message: M) -> None:
        """Record a message that belongs to a dvtcli exchange, or shows its result."""
        self._exchanged.append((message, False, time()))

    def exchanged(self) -> list[tuple[Frame, bool]]:
        """The last exchanges, oldest first: each frame, and whether it is ours."""
        return [(replace(self._frame_of(one), timestamp_s=at_s), ours) for one, ours, at_s in tuple(self._exchanged)]

    def _tell_taps(self, frame: Frame, sent: bool) -> None:
        for tap in tuple(self._taps):
            tap(frame, sent)
