"""A gateway's client: its unanswered lines and settings, and what the gateway reports to it without questions."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, field
from time import time
from typing import TYPE_CHECKING, Any

from dvtcli.domain.gateway_words import LONGEST_LINE, Answer, Done, Failed, GatewayError
from dvtcli.operations.results.frames import GatewayEvent
from dvtcli.simulator.network.hub_client import Client
from dvtcli.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.domain.hint import Hint
    from dvtcli.domain.lss_services import LssAddress
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results import BusEvent
    from dvtcli.operations.results.frames import GatewayHappening
    from dvtcli.operations.user.session_user import Reporter

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


#: the only net
NET = 1
#: how long an SDO of a client may take, since all clients wait meanwhile (ms)
_MOST_SDO_MS = 5000
_HELP = "r w start stop preop reset enable disable set info lss_... (CiA 309-3)"
_NO_NODE = "this gateway is not a node of the bus"
_NO_GUARDING = "who ends guarding starts the node's own reaction to it; enable heartbeat watches a node"
#: unsupported orders of the standard, with reasons
_NOT_HERE = {
    "set id": f"{_NO_NODE}: it has no node-ID",
    "set heartbeat": f"{_NO_NODE}: it sends no heartbeat",
    "set sdo_block": "long objects go in blocks by itself, where a node takes them",
    "init": "the bit rate is that of the bus, which is chosen where the gateway is started",
    "enable guarding": _NO_GUARDING,
    "disable guarding": _NO_GUARDING,
}


def ordered(client: LineClient, name: str, numbers: tuple[int, ...]) -> Answer:
    """Carry out the setting or query *name* of *client*."""
    if name in _NOT_HERE:
        return Failed(GatewayError.NOT_SUPPORTED, _NOT_HERE[name])
    match name, numbers:
        case _, (number,):
            return _set(client, name, number)
        case "boot_up_indication enable" | "boot_up_indication disable", _:
            client.told_boot_ups = name.endswith("enable")
            return Done()
        case "info version", _:
            return Done(f"dvtcli {__version__} CiA 309-3")
        case _:
            return Done(_HELP)


def _set(client: LineClient, name: str, number: int) -> Answer:
    match name:
        case "set network":
            if number != NET:
                return Failed(GatewayError.UNSUPPORTED_NET)
            client.net = number
        case "set node":
            if not 1 <= number <= 127:
                return Failed(GatewayError.UNSUPPORTED_NODE)
            client.node = number
        case "set sdo_timeout":
            return _set_sdo_time_out(client, number)
        case "set command_size" if number > LONGEST_LINE:
            return Failed(GatewayError.OUT_OF_MEMORY, f"a line has {LONGEST_LINE} characters at most")
    return Done()  # also to `set command_timeout`: an answer always comes, within the time of its SDOs


def _set_sdo_time_out(client: LineClient, milliseconds: int) -> Answer:
    if milliseconds > _MOST_SDO_MS:
        return Failed(GatewayError.SYNTAX, f"at most {_MOST_SDO_MS} ms: all clients wait meanwhile")
    client.timeout_s = milliseconds / 1000
    return Done()


class GatewayReporter:
    """Passes events to *told*, or as text to *reporter* if None; drops questions and progress.

    *client* is the name of the client being served, or None.
    """

    def __init__(self, reporter: Reporter, told: Callable[[GatewayEvent], None] | None = None) -> None:
        self._tell, self._told = reporter, told
        self.client: str | None = None

    def happened(self, event: GatewayHappening, text: Hint | str, **facts: Any) -> None:
        """Report an *event*; *facts* are its further fields."""
        if self._told is not None:
            self._told(GatewayEvent(event, time(), text, **{"client": self.client, **facts}))
        elif event == "warning":
            self._tell.warning(text)
        else:
            self._tell.note(text)

    def note(self, text: Hint | str) -> None:
        """Hand it on."""
        self.happened("note", text)

    def warning(self, text: Hint | str) -> None:
        """Hand it on."""
        self.happened("warning", text)

    def bus(self, event: BusEvent) -> None:
        """Hand it on."""
        self._tell.bus(event)

    def instruct(self, text: str) -> None:
        """Hand it on."""
        self._tell.instruct(text)

    @property
    def unanswered(self) -> str:
        """Why a question has no answer."""
        return self._tell.unanswered

    def ask(self, question: str) -> bool | None:  # noqa: ARG002
        """Nobody can answer."""
        return None

    def confirm(self, question: str, word: str) -> bool | None:  # noqa: ARG002
        """Nobody can answer."""
        return None

    def progress(self, text: str, done: int, total: int) -> None:
        """Show nothing."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Hand it on."""
        self._tell.traffic(frame, sent=sent, secret=secret)
