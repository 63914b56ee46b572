"""One client of a hub: its requests in the socketcand protocol, the answers, and data waiting to be sent.

All I/O is non-blocking.
"""

from __future__ import annotations

import re
import selectors
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from time import monotonic

from dvtcli.domain.ports import Frame

#: python-can wants the answer to `rawmode` alone in one read, and on a busy machine that read is late: frames wait so
#: long, or until the client speaks (s)
HOLD_S = 0.5
#: how often a client that takes nothing is looked at, at least (s)
LOOK_S = 0.2
_READ = 64 * 1024
#: clients that wait for an acknowledgement before they send their next frame get it at once, where the system can
_QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)


@dataclass(slots=True)
class Requests:
    """Splits a client's bytes into requests, however they were divided on the way."""

    _rest: bytes = field(default=b"")

    def feed(self, data: bytes) -> list[bytes]:
        """The requests completed by *data*, without their brackets. Raises RubbishError for anything else."""
        text = self._rest + data
        found, end = [], 0
        while (match := _ELEMENT.match(text, end)) is not None:
            found.append(match[1].strip())
            end = match.end()
        self._rest = text[end:].lstrip(b" \t\r\n\0")
        if self._rest and (not self._rest.startswith(b"<") or len(self._rest) > LONGEST):
            raise RubbishError(f"{self._rest[:32]!r} is not a socketcand request")
        return found


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
    queued_by_sender: dict[object, int] = field(default_factory=dict)
    #: when something was last taken, or began to wait
    last_sent_s: float = 0.0
    #: the time of the last flush
    last_flush_s: float = 0.0
    blocked: bool = False
    events: int = selectors.EVENT_READ
    #: true if the client sent data since the last send to it
    unanswered: bool = False
    complained: bool = False
    #: host and port of the client, and the time of its last data (s)
    peer: tuple[str, int] = ("", 0)
    last_received_s: float = 0.0
    #: true if the connection has ended or must end, and the reason for the user, if any
    gone: bool = False
    why: str | None = None

    @property
    def waiting(self) -> int:
        """The number of unsent bytes."""
        return len(self.out) + len(self.held)

    def put(self, text: bytes, source: object) -> None:
        """Queue the *text* of a frame of *source*."""
        self.queued_by_sender[source] = self.queued_by_sender.get(source, 0) + len(text)
        (self.out if self.held_until_s is None else self.held).extend(text)

    def reply(self, text: bytes) -> None:
        """Queue an answer ahead of all held frames."""
        self.queued_by_sender[self] = self.queued_by_sender.get(self, 0) + len(text)
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
            self.last_sent_s = monotonic()
            del self.out[:sent]
        self.blocked = bool(self.out)
        if not self.waiting:
            self.queued_by_sender.clear()

    def flush(self, now_s: float, stall_s: float, most: int) -> None:
        """Send waiting data at *now_s* on the monotonic clock, and decide whether the client must go.

        It must go after reading nothing for *stall_s* (s), or more than *most* bytes behind. Time without a call does
        not count: a stopped server drops nobody.
        """
        self.last_sent_s = min(now_s, self.last_sent_s + max(0.0, now_s - self.last_flush_s - LOOK_S))
        self.last_flush_s = now_s
        if self.held_until_s is not None and self.held_until_s <= now_s:
            self.release()
        if not self.out:
            self.last_sent_s = now_s
        elif self.waiting > most:
            self.gone, self.why = True, f"{self.waiting} bytes wait for it: it reads too slowly"
        elif self.blocked and now_s - self.last_sent_s >= stall_s:
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
        self.last_received_s = monotonic()
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
                frame = parse_send(request)
            except ValueError as wrong:
                self._complain(request, SYNTAX, str(wrong))
                return None
            if frame is not None:
                return frame
        if not self.opened and parse_open(request) is not None:
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


HI, OK, ECHO = b"< hi >", b"< ok >", b"< echo >"
UNKNOWN, SYNTAX = b"< error unknown command >", b"< error syntax >"
#: the longest request of a client: a `send` with 8 bytes has 45 characters
LONGEST = 512
#: longest name of a bus, as socketcand has it
_LONGEST_NAME = 16
_DIGITS = b"0123456789abcdefABCDEF"
_ELEMENT = re.compile(rb"[\s\0]*<([^<>]*)>")
_SEND = re.compile(rb"send +([0-9A-Fa-f]{1,8}) +(?:0[xX])?([0-8])((?: +[0-9A-Fa-f]{1,2})*)")
_SEND_RTR = re.compile(rb"sendrtr +([0-9A-Fa-f]{1,8}) +([0-8])")
_BASE_DIGITS = 3
#: every byte as clients write it: `a`, `A`, `0a`, `0A`, `fF`, …
_BYTES = {bytes(digits): int(bytes(digits), 16) for count in (1, 2) for digits in product(_DIGITS, repeat=count)}


class RubbishError(ValueError):
    """The received data is not the protocol."""


def parse_send(request: bytes) -> Frame | None:
    """The frame of a `send` or `sendrtr`; None for another *request*. Raises ValueError if malformed."""
    match = _SEND.fullmatch(request)
    if match is not None:
        data = bytes(map(_BYTES.__getitem__, match[3].split()))
        if len(data) != int(match[2]):
            raise ValueError("length and data differ")
        return _frame(match[1], data, remote=False)
    if not request.startswith(b"send"):
        return None
    match = _SEND_RTR.fullmatch(request)
    if match is None:
        raise ValueError("no such frame")
    return _frame(match[1], b"", remote=True, dlc=int(match[2]))


def _frame(digits: bytes, data: bytes, *, remote: bool, dlc: int = 0) -> Frame:
    can_id, extended = int(digits, 16), len(digits) > _BASE_DIGITS
    if can_id > (0x1FFF_FFFF if extended else 0x7FF):
        raise ValueError("no such CAN-ID")
    return Frame(can_id, data, extended, remote, dlc=dlc)


def parse_open(request: bytes) -> bytes | None:
    """The bus name in an `open`; None if *request* is not a valid `open`."""
    words = request.split()
    return words[1] if len(words) == 2 and words[0] == b"open" and len(words[1]) <= _LONGEST_NAME else None


def frame_line(frame: Frame, wall_s: float) -> bytes:
    """*frame* in the form for clients; *wall_s* is its time, in seconds since 1970."""
    digits = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
    if frame.remote:
        return f"< rtr {digits} {wall_s:.6f} {frame.dlc} >".encode()
    return f"< frame {digits} {wall_s:.6f} {frame.data.hex().upper()} >".encode()
