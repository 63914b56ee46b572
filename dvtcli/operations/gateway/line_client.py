"""A gateway's client: its unanswered lines and settings."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.gateway.gateway_words import LONGEST_LINE
from dvtcli.simulator.network.hub_client import Client

if TYPE_CHECKING:
    from dvtcli.domain.lss_services import LssAddress
    from dvtcli.domain.ports import Frame

#: unanswered lines before reading stops
MOST_LINES = 16
#: the first words of a browser; a web page can make it send them to this machine, followed by lines of its own
_HTTP = re.compile(r"[A-Z]+ \S+ HTTP/\d")


@dataclass(eq=False, slots=True)
class LineClient(Client):
    """A connection with lines."""

    lines: deque[str] = field(default_factory=deque)
    rest: bytes = b""
    #: its default node and net, None for none, and its SDO time-out (s), None: as in the options
    node: int | None = None
    net: int | None = 1
    timeout_s: float | None = None
    #: whether it gets boot-ups
    told_boot_ups: bool = True
    #: its slave selected by LSS
    selected: LssAddress | None = None
    #: whether its next line waits for a restarting node
    stalled: bool = False
    #: time of its next turn, in the gateway's count of line time (s)
    turn_s: float = 0.0
    #: how long others waited for nodes that did not answer it (s)
    waited_s: float = 0.0

    def greet(self) -> None:
        """Do nothing: a gateway does not speak first."""

    def take(self, data: bytes) -> list[Frame]:
        """Keep the lines completed by *data*; a client with an endless line or HTTP is disconnected."""
        *lines, self.rest = (self.rest + data).split(b"\n")
        self.lines.extend(line.decode("latin-1").rstrip("\r") for line in lines)
        if any(map(_HTTP.match, self.lines)):
            self.lines.clear()
            self.gone, self.why = True, "an HTTP request, as a web page sends it: nothing of it was done"
        if len(self.rest) > LONGEST_LINE:
            self.gone, self.why = True, f"a line of more than {LONGEST_LINE} characters"
        return []
