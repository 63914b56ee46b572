"""A gateway's client: its unanswered lines and settings."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.gateway.line_words import LONGEST_LINE
from dvtcli.simulator.network.hub_client import Client

if TYPE_CHECKING:
    from dvtcli.domain.lss_services import LssAddress
    from dvtcli.domain.ports import Frame

#: lines that may wait for an answer before more is read
MOST_LINES = 16
#: what a browser says first; any web page can make it say so to this machine, with lines of the page's own behind
_HTTP = re.compile(r"[A-Z]+ \S+ HTTP/\d")


@dataclass(eq=False, slots=True)
class LineClient(Client):
    """A connection with lines."""

    lines: deque[str] = field(default_factory=deque)
    rest: bytes = b""
    #: its default node and net, None for none, and how long an SDO answer may take (s), None: what the options say
    node: int | None = None
    net: int | None = 1
    timeout_s: float | None = None
    #: whether it is told of boot-ups
    told_boot_ups: bool = True
    #: the slave that it selected by LSS
    selected: LssAddress | None = None
    #: whether its next line has to wait for a node that restarts
    stalled: bool = False
    #: when its next turn comes, on the gateway's count of the time that lines took (s)
    turn_s: float = 0.0
    #: how long all had to wait for nodes that did not answer it (s)
    waited_s: float = 0.0

    def greet(self) -> None:
        """A gateway says nothing first."""

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
