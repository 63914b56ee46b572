"""Frames as they pass: for those who receive, those who watch, and those that answer a frame of ours.

Does not know what a frame means.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from queue import SimpleQueue
from time import monotonic
from typing import TYPE_CHECKING
from weakref import ref

from dvtcli.bus.receiver import Wake
from dvtcli.domain.ports import Frame

if TYPE_CHECKING:
    import can

#: frames that arrive after one of ours was sent are kept for a `receive` that follows within this time (s)
ANSWERS_KEPT_S = 1.0

Tap = Callable[[Frame, bool], None]


def frame_of(message: can.Message) -> Frame:
    """python-can's message as a frame."""
    return Frame(
        message.arbitration_id,
        bytes(message.data),
        extended=message.is_extended_id,
        remote=message.is_remote_frame,
        timestamp_s=message.timestamp,
    )


class Traffic:
    """Passes frames on to everyone who listens."""

    def __init__(self) -> None:
        self._listeners: list[ref[SimpleQueue[Frame | Wake]]] = []
        self._taps: list[Tap] = []
        self._answers: deque[can.Message] = deque(maxlen=4096)
        self._kept_until_s = 0.0

    def tap(self, callback: Tap) -> Callable[[], None]:
        """Call *callback*(frame, sent) for each frame; returns what ends that."""
        self._taps.append(callback)
        return lambda: self._taps.remove(callback)

    def keep_answers(self) -> None:
        """From now on, keep what arrives for the next `listen`: an answer may be there before it."""
        self._answers.clear()
        self._kept_until_s = monotonic() + ANSWERS_KEPT_S

    def listen(self) -> SimpleQueue[Frame | Wake]:
        """A queue that gets every frame from now on for as long as it is referred to, after the kept ones."""
        inbox: SimpleQueue[Frame | Wake] = SimpleQueue()
        if monotonic() < self._kept_until_s:
            for message in tuple(self._answers):
                inbox.put(frame_of(message))
        self._kept_until_s = 0.0
        self._listeners.append(ref(inbox, self._listeners.remove))
        return inbox

    def received(self, message: can.Message) -> None:
        """Pass on a message from the bus."""
        if self._kept_until_s:
            self._answers.append(message)
        if self._taps or self._listeners:
            frame = frame_of(message)
            for listener in tuple(self._listeners):
                inbox = listener()
                if inbox is not None:
                    inbox.put(frame)
            self._tell_taps(frame, False)

    def sent(self, message: can.Message) -> None:
        """Pass on a message of ours."""
        if self._taps:
            self._tell_taps(frame_of(message), True)

    def _tell_taps(self, frame: Frame, sent: bool) -> None:
        for tap in tuple(self._taps):
            tap(frame, sent)
