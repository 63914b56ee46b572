"""Killing a dvtcli at work on served nodes, at a frame of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can

from tests.forked import Forked
from tests.posix import SIGKILL
from tests.serve.served import Served


@contextmanager
def killing(nodes: Served, child: Forked, at: int, which: Callable[[can.Message], bool]) -> Iterator[None]:
    """Kill *child* at the *at*-th of those frames on the bus that *which* tells."""
    bus, stop = nodes.attach(), threading.Event()

    def watch() -> None:
        seen = 0
        while not stop.is_set():
            frame = bus.recv(0.05)
            seen += frame is not None and which(frame)
            if frame is not None and which(frame) and seen == at:
                child.send_signal(SIGKILL)

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
