"""Wait for a missing bus: retry with growing pauses, and at once after kernel news."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from select import select
from time import monotonic, sleep
from typing import TypeVar

from dvtcli.errors import BusUnavailable

B = TypeVar("B")
#: pause between two tries (s): first, and maximum
FIRST_S, MOST_S = 0.1, 2.0
#: maximum delay until *stopping* is noticed (s)
_SLICE_S = 0.05
#: rtnetlink's group for link events (linux/rtnetlink.h)
_LINK_NEWS = 1


def wait_for_bus(open_once: Callable[[], B], stopping: Callable[[], bool]) -> B | None:
    """Try *open_once* until the bus opens; None as soon as *stopping*().

    The pause doubles between tries up to MOST_S; kernel news about a link end it.
    """
    pause_s = FIRST_S
    with _link_news() as news:
        while not stopping():
            with suppress(BusUnavailable):
                return open_once()
            pause_s = FIRST_S if _rested(news, pause_s, stopping) else min(2 * pause_s, MOST_S)
    return None


def _rested(news: socket.socket | None, pause_s: float, stopping: Callable[[], bool]) -> bool:
    """Wait *pause_s*, or until *stopping*() or a link event; True for a link event."""
    end_s = monotonic() + pause_s
    while not stopping() and (left_s := end_s - monotonic()) > 0:
        if news is None:
            sleep(min(left_s, _SLICE_S))
        elif select([news], [], [], min(left_s, _SLICE_S))[0]:
            sleep(_SLICE_S)  # events come in groups, as a link is set up in several steps
            _read_all(news)
            return True
    return False


def _read_all(news: socket.socket) -> None:
    with suppress(OSError):  # no more events; or so many that some were lost, which is an event, too
        while news.recv(1 << 16):
            pass


@contextmanager
def _link_news() -> Iterator[socket.socket | None]:
    """A socket that is readable after a link event; None if the kernel has no such events."""
    family = getattr(socket, "AF_NETLINK", None)
    news = None
    if family is not None:
        with suppress(OSError):  # a sandbox, or a kernel without it
            news = socket.socket(family, socket.SOCK_RAW, 0)
            news.setblocking(False)
            news.bind((0, _LINK_NEWS))
    try:
        yield news
    finally:
        if news is not None:
            news.close()
