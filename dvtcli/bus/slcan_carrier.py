"""A serial line with an slcan adapter as what carries a bus: lines that lost characters, a bit rate that nobody set.

Does not know CANopen, nor the protocol's lines, which python-can reads.
"""

from __future__ import annotations

import can

from dvtcli.bus.carrier import Carrier
from dvtcli.domain.several import plural


class SlcanCarrier(Carrier):
    """The adapter at *port*; *asked* is the bit rate (bit/s) that the user wants, None where none was given."""

    def __init__(self, port: str, asked: int | None) -> None:
        self._damaged = self._told_damaged = 0
        self._news: list[str] = []
        if asked is None:
            self._news.append(
                f"no bit rate is given: {port} keeps the bit rate that it has; without one it does not open"
            )

    def is_damaged(self, error: Exception) -> bool:
        """Whether *error* of receiving is a line that is no frame: characters were lost, and the next line is whole."""
        damaged = isinstance(error, ValueError | IndexError) and not isinstance(error, can.CanError)
        self._damaged += damaged
        return damaged

    def news(self) -> list[str]:
        """A bit rate that was not given, and lines that were damaged."""
        news, self._news = self._news, []
        if self._damaged > self._told_damaged:
            lines = plural(self._damaged - self._told_damaged, "damaged line")
            news.append(
                f"the adapter sent {lines}, whose frames are missing: characters were lost on the serial line; "
                "another cable or port, or the interface's setting rtscts=true"
            )
            self._told_damaged = self._damaged
        return news

    def lost_frames(self) -> int:
        """How many lines were damaged."""
        return self._damaged
