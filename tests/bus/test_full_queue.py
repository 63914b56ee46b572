"""A transmit queue that is full for a while is waited for; one that stays full is told with what to look at.

The driver here is python-can's virtual bus with a queue that takes nothing for some tries, as SocketCAN says it.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

import can
import pytest
from can.interfaces.virtual import VirtualBus

from dvtcli.bus.python_can import CanBus
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable

_NUMBERS = count(1)
NO_BUFFER = can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)


class FullBus(VirtualBus):
    """Takes a frame only after *tries* that fail with *failure*."""

    def __init__(self, channel: str, failure: Exception, tries: int, **options: Any) -> None:
        super().__init__(channel, **options)
        self._failure, self._tries = failure, tries

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self._tries:
            self._tries -= 1
            raise self._failure
        super().send(msg, timeout)


Open = Callable[..., tuple[CanBus, can.BusABC]]


@pytest.fixture
def full() -> Iterator[Open]:
    """A CanBus whose queue is full, and another program on the same channel."""
    opened: list[tuple[CanBus, can.BusABC]] = []

    def start(failure: Exception, tries: int) -> tuple[CanBus, can.BusABC]:
        channel = f"full-{next(_NUMBERS)}"
        ours = CanBus(FullBus(channel, failure, tries), f"virtual:{channel}")
        opened.append((ours, can.Bus(channel, interface="virtual", ignore_config=True)))
        return opened[-1]

    yield start
    for bus, other in opened:
        bus.close()
        other.shutdown()


def test_a_full_queue_is_waited_for(full: Open) -> None:
    bus, other = full(NO_BUFFER, 5)
    for data in (b"\x01", b"\x02"):
        bus.send(Frame(0x201, data))
    received = [other.recv(10), other.recv(10)]
    assert [bytes(message.data) for message in received if message is not None] == [b"\x01", b"\x02"]


def test_one_that_stays_full_is_told(full: Open) -> None:
    bus, other = full(NO_BUFFER, 1 << 30)
    with pytest.raises(BusUnavailable) as caught:
        bus.send(Frame(0x201, b"\x01"))
    assert "No buffer space" in str(caught.value.why)
    assert other.recv(0) is None


def test_what_is_no_full_queue_is_told_at_once(full: Open) -> None:
    bus, _ = full(can.CanOperationError("Failed to transmit: Network is down", errno.ENETDOWN), 1)
    with pytest.raises(BusUnavailable):
        bus.send(Frame(0x201, b"\x01"))
