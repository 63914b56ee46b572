"""Echoes of our own frames, told by what was sent.

A driver's own mark says something else: SocketCAN marks every frame of the same host, other drivers mark no echo.
Knows frames and their order. Does not read the bus, nor know what a frame means.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import can

#: a frame that was sent: CAN-ID, extended, remote, data
_Sent = tuple[int, bool, bool, bytes]

#: frames that may wait for their echo at a time; more are not under way between two reads
MOST_REMEMBERED = 1024
#: a controller may send by priority; an echo that is this much (s) behind its sending, or a later frame's, was lost
LOST_AFTER_S = 1.0


class Echoes:
    """What was sent and may still come back.

    Whether a bus echoes at all is found out: an echo comes before the answer to what it echoes.
    """

    def __init__(self) -> None:
        #: whether the bus echoes, None where nobody knows yet
        self._echoing: bool | None = None
        self._sent: deque[tuple[_Sent, float]] = deque(maxlen=MOST_REMEMBERED)
        self._lock = threading.Lock()

    def rule_out(self) -> None:
        """The driver is known to hand none of our frames back: whatever comes is somebody else's."""
        self._echoing = False

    def expect(self, message: can.Message, now_s: float) -> None:
        """*message* is about to be sent at *now_s*: before that, since its echo may be read by another thread."""
        if self._echoing is not False:
            with self._lock:
                self._sent.append((_key(message), now_s))

    def unsent(self) -> None:
        """The last one could not be sent."""
        with self._lock:
            if self._sent:
                self._sent.pop()

    def is_echo(self, message: can.Message) -> bool:
        """Whether a received *message* is one of ours come back; each comes back once."""
        if not self._sent:
            return False
        key = _key(message)
        with self._lock:
            place = next((place for place, (sent, _) in enumerate(self._sent) if sent == key), None)
            if place is None:
                return False
            self._echoing = True
            sent_s = self._sent[place][1]
            del self._sent[place]
            while self._sent and sent_s - self._sent[0][1] > LOST_AFTER_S:
                self._sent.popleft()
            return True

    def caught_up(self, now_s: float) -> None:
        """At *now_s* everything that had arrived was read: what was sent long before that does not come back.

        Where the bus is known to echo it may: a controller sends again and again until another node acknowledges.
        """
        if self._echoing is not None or not self._sent:
            return
        with self._lock:
            while self._sent and now_s - self._sent[0][1] > LOST_AFTER_S:
                self._sent.popleft()

    def answered(self, can_id: int) -> None:
        """A request to *can_id* was answered: where no echo was ever seen, it and what was sent before have none."""
        if self._echoing is not None or not self._sent:
            return
        with self._lock:
            asked = [place for place, (sent, _) in enumerate(self._sent) if sent[0] == can_id]
            for _ in range(asked[0] + 1 if asked else 0):
                self._sent.popleft()


def _key(message: can.Message) -> _Sent:
    return message.arbitration_id, message.is_extended_id, message.is_remote_frame, bytes(message.data)
