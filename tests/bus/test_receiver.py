"""Whoever waits for something on a bus is woken, whatever the others do and however busy the bus is."""

from __future__ import annotations

import threading
from queue import SimpleQueue
from time import monotonic, sleep

from dvtcli.bus.receiver import GRACE_S, Receiver, Wake
from tests.process import PATIENCE_S


class Endless(SimpleQueue[bytes | Wake]):
    """A queue whose time-out is lost, as CPython loses it after a wake-up in vain in its last moment."""

    def get(self, block: bool = True, timeout: float | None = None) -> bytes | Wake:
        """Wait for ever."""
        del timeout
        return super().get(block)


def test_on_a_bus_that_is_never_quiet_who_reads_ends_the_time_of_the_others() -> None:
    """Nobody depends on the time-out of a queue."""
    reads, ended = threading.Event(), threading.Event()
    longest_s = monotonic() + PATIENCE_S

    def read(_wait_s: float) -> bytes:
        reads.set()
        sleep(0)
        return b"always something"

    def lead() -> None:
        while not ended.is_set() and monotonic() < longest_s:
            receiver.take(mine, longest_s)

    def deliver(_message: bytes) -> None:
        if ended.is_set():
            mine.put(b"enough")

    receiver: Receiver[bytes] = Receiver(read, deliver)
    mine: SimpleQueue[bytes | Wake] = SimpleQueue()
    leading = threading.Thread(target=lead)
    leading.start()
    assert reads.wait(PATIENCE_S)
    answers: list[bytes | None] = []
    following = threading.Thread(
        target=lambda: answers.append(receiver.take(Endless(), monotonic() - 2 * GRACE_S)), daemon=True
    )
    following.start()
    following.join(PATIENCE_S / 4)
    ended.set()
    leading.join(PATIENCE_S)
    assert answers == [None]
