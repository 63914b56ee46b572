"""What a CanBus asks of what carries it, besides frames: whether it is gone, full, or lost something, and what to do.

Most of python-can's drivers say nothing of that. Does not know CANopen.
"""

from __future__ import annotations

import errno

from dvtcli.domain.hint import Hint

#: what the system says of a link, a port or a connection that is no more
_GONE = frozenset(
    {errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EIO, errno.EPIPE, errno.ECONNRESET, errno.ECONNABORTED}
)


class Carrier:
    """A carrier of which nothing more is known than what its driver raises."""

    #: what it really runs at (bit/s), None where that is not known
    bit_rate: int | None = None

    def hear(self, *, everything: bool) -> None:
        """Let come *everything*, or only what nodes say to a configurator, where the system can tell that apart."""

    def make_room(self) -> None:
        """Let more frames wait to be read than an answer needs, where the system can do that: each one is wanted."""

    def hung_up(self) -> bool:
        """Whether the other end is gone, where the driver only falls silent."""
        return False

    def is_full(self, error: Exception) -> bool:
        """Whether *error* of sending only says that a frame had to wait, so that it can be tried again."""
        return getattr(error, "error_code", None) == errno.ENOBUFS

    def is_gone(self, error: Exception) -> bool:
        """Whether *error* of sending says that the way to the bus is no more."""
        number = getattr(error, "error_code", None) or getattr(error, "errno", None)
        return number in _GONE or isinstance(error, ConnectionError)

    def is_damaged(self, _error: Exception) -> bool:
        """Whether an error of receiving is one frame that came damaged, so that the next one can be read."""
        return False

    def lost_frames(self) -> int:
        """How many frames came so far that were dropped before anybody could read them."""
        return 0

    def news(self) -> list[str]:
        """What should be known of it and was not told yet, in words."""
        return []

    def next_step(self, error: Exception) -> Hint | str:
        """What to do after *error* of sending or receiving."""
        if isinstance(error, ConnectionError):
            return "is the server still running?"
        return "is the adapter still plugged in, and the interface up?"
