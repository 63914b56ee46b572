"""Driver state besides frames: full queue, lost frames, and advice.

Most python-can drivers report none of these.
"""

from __future__ import annotations

import errno

from dvtcli.domain.hint import Hint

#: error numbers of a lost link, port or connection
_GONE = frozenset(
    {errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EIO, errno.EPIPE, errno.ECONNRESET, errno.ECONNABORTED}
    | {errno.ETIMEDOUT}
)


class Carrier:
    """A driver that reports nothing but the errors it raises."""

    #: actual bit rate (bit/s), None if unknown
    bit_rate: int | None = None

    def hear(self, *, everything: bool) -> None:
        """Receive *everything*, or only frames for a configurator, if the system can filter."""

    def make_room(self) -> None:
        """Enlarge the receive buffer if possible, since every frame is wanted."""

    def may_have_frames(self) -> bool:
        """Whether a read may return something at once, a frame or an error; True if only a read can tell."""
        return True

    def is_full(self, error: Exception) -> bool:
        """Whether sending failed with *error* because a queue was full, so that a retry may succeed."""
        return getattr(error, "error_code", None) == errno.ENOBUFS

    def is_gone(self, error: Exception) -> bool:
        """Whether *error* while sending means a lost connection to the bus."""
        number = getattr(error, "error_code", None) or getattr(error, "errno", None)
        return number in _GONE or isinstance(error, ConnectionError)

    def is_damaged(self, _error: Exception) -> bool:
        """Whether an error while receiving concerns one damaged frame, so that the next frame can be read."""
        return False

    def lost_frames(self) -> int:
        """Number of frames lost before they could be read."""
        return 0

    def news(self) -> list[str]:
        """Unreported news about the driver, in words."""
        return []

    def next_step(self, error: Exception) -> Hint | str:
        """Advice after *error* of sending or receiving."""
        if isinstance(error, ConnectionError):
            return "is the server still running?"
        return "is the adapter still plugged in, and the interface up?"
