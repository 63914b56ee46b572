"""One client of a hub: its requests in the socketcand protocol, the answers, and data waiting to be sent.

All I/O is non-blocking.
"""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from time import monotonic

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.socketcand import (
    ECHO,
    HI,
    OK,
    SYNTAX,
    UNKNOWN,
    Requests,
    RubbishError,
    opened_bus,
    sent_frame,
)

#: python-can wants the answer to `rawmode` alone in one read, and on a busy machine that read is late: frames wait so
#: long, or until the client speaks (s)
HOLD_S = 0.5
#: how often a client that takes nothing is looked at, at least (s)
LOOK_S = 0.2
_READ = 64 * 1024
#: clients that wait for an acknowledgement before they send their next frame get it at once, where the system can
_QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)


@dataclass(eq=False, slots=True)
class Client:
    """One connection with its unread requests and unsent data; *tell* takes one line for the user."""

    connection: socket.socket
    name: str
    tell: Callable[[str], None]
    requests: Requests = field(default_factory=Requests)
    opened: bool = False
    raw: bool = False
    #: unsent data, and frames held until release
    out: bytearray = field(default_factory=bytearray)
    held: bytearray = field(default_factory=bytearray)
    held_until_s: float | None = None
    #: queued bytes per sender since the queue was last empty
    owed: dict[object, int] = field(default_factory=dict)
    #: when something was last taken, or began to wait
    progress_s: float = 0.0
    #: the time of the last flush
    looked_s: float = 0.0
    blocked: bool = False
    events: int = selectors.EVENT_READ
    #: true if the client sent data since the last send to it
    unanswered: bool = False
    complained: bool = False
    #: host and port of the client, and the time of its last data (s)
    peer: tuple[str, int] = ("", 0)
    said_s: float = 0.0
    #: true if the connection has ended or must end, and the reason for the user, if any
    gone: bool = False
    why: str | None = None

    @property
    def waiting(self) -> int:
        """The number of unsent bytes."""
        return len(self.out) + len(self.held)

    def put(self, text: bytes, source: object) -> None:
        """Queue the *text* of a frame of *source*."""
        self.owed[source] = self.owed.get(source, 0) + len(text)
        (self.out if self.held_until_s is None else self.held).extend(text)

    def reply(self, text: bytes) -> None:
        """Queue an answer ahead of all held frames."""
        self.owed[self] = self.owed.get(self, 0) + len(text)
        self.out.extend(text)
        if not self.blocked:
            self.send()

    def release(self) -> None:
        """Allow frames again: the client has read the answer sent alone."""
        if self.held_until_s is not None:
            self.held_until_s = None
            self.out.extend(self.held)
            self.held.clear()

    def send(self) -> None:
        """Send as much as possible without waiting."""
        try:
            sent = self.connection.send(self.out)
        except BlockingIOError:
            sent = 0
        except OSError:
            self.gone = True
            return
        if sent:
            self.unanswered = False
            self.progress_s = monotonic()
            del self.out[:sent]
        self.blocked = bool(self.out)
        if not self.waiting:
            self.owed.clear()

    def flush(self, now_s: float, stall_s: float, most: int) -> None:
        """Send waiting data at *now_s* on the monotonic clock, and decide whether the client must go.

        It must go after reading nothing for *stall_s* (s), or more than *most* bytes behind. Time without a call does
        not count: a stopped server drops nobody.
        """
        self.progress_s = min(now_s, self.progress_s + max(0.0, now_s - self.looked_s - LOOK_S))
        self.looked_s = now_s
        if self.held_until_s is not None and self.held_until_s <= now_s:
            self.release()
        if not self.out:
            self.progress_s = now_s
        elif self.waiting > most:
            self.gone, self.why = True, f"{self.waiting} bytes wait for it: it reads too slowly"
        elif self.blocked and now_s - self.progress_s >= stall_s:
            self.gone, self.why = True, f"took nothing for {stall_s:g} s while frames waited for it"
        elif not self.blocked:
            self.send()

    def acknowledge(self) -> None:
        """Let the system acknowledge the client's data, since no answer does."""
        self.unanswered = False
        if _QUICK_ACK is not None:
            with suppress(OSError):  # it has hung up
                self.connection.setsockopt(socket.IPPROTO_TCP, _QUICK_ACK, 1)

    def read(self) -> list[Frame]:
        """Obey the client's requests so far; the frames it sends."""
        try:
            data = self.connection.recv(_READ)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self.gone = True
            return []
        self.unanswered = True
        self.said_s = monotonic()
        self.release()
        return self.take(data)

    def greet(self) -> None:
        """Send the greeting."""
        self.reply(HI)

    def take(self, data: bytes) -> list[Frame]:
        """Obey the requests in *data*; the frames it contains."""
        try:
            requests = self.requests.feed(data)
        except RubbishError as rubbish:
            self.gone, self.why = True, str(rubbish)
            return []
        return [frame for frame in map(self._obey, requests) if frame is not None]

    def _obey(self, request: bytes) -> Frame | None:
        """Obey *request*; its frame, if any."""
        if self.opened:
            try:
                frame = sent_frame(request)
            except ValueError as wrong:
                self._complain(request, SYNTAX, str(wrong))
                return None
            if frame is not None:
                return frame
        if not self.opened and opened_bus(request) is not None:
            self.opened = True
            self.reply(OK)
        elif self.opened and request in (b"rawmode", b"bcmmode"):
            self.raw = request == b"rawmode"
            self.reply(OK)
            self.held_until_s = monotonic() + HOLD_S
        elif self.opened and request == b"echo":
            self.reply(ECHO)
        else:
            self._complain(request, UNKNOWN, "no such request here")
        return None

    def _complain(self, request: bytes, answer: bytes, why: str) -> None:
        """Refuse *request*, with a message to the user once per client."""
        self.reply(answer)
        if not self.complained:
            self.complained = True
            self.tell(f"client {self.name} asked {request[:60]!r}: {why}")
