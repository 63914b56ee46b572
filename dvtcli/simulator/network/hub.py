"""Clients that share one bus over TCP, by the socketcand protocol.

One thread calls everything but `wake`. Loses no frame: what a client does not read yet is kept, `congested` says that
others should wait for it, and one that takes nothing for `STALL_S` is dropped. Does not know nodes or bit rates.
"""

from __future__ import annotations

import errno
import selectors
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from time import monotonic

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.socketcand import HI, OK, SYNTAX, UNKNOWN, Requests, RubbishError, opened_bus, sent_frame

#: how long a client may take nothing while something waits for it (s)
STALL_S = 5.0
#: python-can wants the answer to `rawmode` alone in one read: frames wait so long, or until the client speaks (s)
HOLD_S = 0.1
#: clients at once, and what is kept for one before the others wait (bytes; a frame is some 45)
MOST_CLIENTS, MOST_KEPT = 64, 256 * 1024
_READ = 64 * 1024
#: how long nobody is let in after the system had no room for a client (s)
_FULL_S = 1.0
_NO_ROOM = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
#: clients that wait for an acknowledgement before they send their next frame get it at once, where the system can
_QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)

MayRead = Callable[["Client"], bool]


@dataclass(eq=False, slots=True)
class Client:
    """One connection: what it said so far, and what waits for it."""

    connection: socket.socket
    name: str
    requests: Requests = field(default_factory=Requests)
    opened: bool = False
    raw: bool = False
    #: what waits to be sent, and what waits until frames may follow
    out: bytearray = field(default_factory=bytearray)
    held: bytearray = field(default_factory=bytearray)
    held_until_s: float | None = None
    #: when something was last taken, or began to wait
    progress_s: float = 0.0
    blocked: bool = False
    events: int = selectors.EVENT_READ
    #: whether it said something since anything was sent to it
    unanswered: bool = False
    complained: bool = False


class Hub:
    """Listens at *address* (host, port; port 0 is a free one), or only waits where that is None.

    *tell* takes one line about a client; one that takes nothing for *stall_s* is dropped. OSError where the address is
    not to be had. Ends with `close`.
    """

    def __init__(self, address: tuple[str, int] | None, tell: Callable[[str], None], stall_s: float = STALL_S) -> None:
        self._tell = tell
        self._stall_s = stall_s
        self._selector = selectors.SelectSelector()  # the only one that waits for less than a millisecond
        self._clients: dict[socket.socket, Client] = {}
        #: until when nobody is let in (s), None where clients may come; and whether the user was told
        self._full_until_s: float | None = None
        self._full_told = False
        self._listener = None if address is None else _listener(address)
        #: port that it listens at, None where it does not
        self.port: int | None = None if self._listener is None else self._listener.getsockname()[1]
        self._awake, self._waker = socket.socketpair()
        for each in (self._awake, self._waker):
            each.setblocking(False)
        self._selector.register(self._awake, selectors.EVENT_READ)
        if self._listener is not None:
            self._selector.register(self._listener, selectors.EVENT_READ)

    @property
    def clients(self) -> int:
        """How many clients are connected."""
        return len(self._clients)

    @property
    def congested(self) -> bool:
        """Whether a client has so much to read that the others should wait for it."""
        return any(len(client.out) + len(client.held) > MOST_KEPT for client in self._clients.values())

    def wake(self) -> None:
        """End a `wait`, from any thread or signal handler."""
        with suppress(OSError):  # it is full of wake-ups already, or closed
            self._waker.send(b"\0")

    def tell_all(self, text: bytes, source: object) -> None:
        """Put *text* on its way to every client in raw mode but *source*."""
        for client in self._clients.values():
            if client.raw and client is not source:
                (client.out if client.held_until_s is None else client.held).extend(text)

    def wait(self, timeout_s: float, may_read: MayRead) -> list[tuple[Client, Frame]]:
        """Send what waits, then the frames that clients sent within *timeout_s* (s), at once if there are some.

        Only clients for which *may_read* holds are read, and none while it is congested; the others keep what they say.
        """
        self._flush()
        self._open_again()
        congested = self.congested
        for client in self._clients.values():
            self._listen(client, not congested and may_read(client))
            if client.unanswered:
                self._acknowledge(client)
        frames: list[tuple[Client, Frame]] = []
        for key, events in self._selector.select(max(0.0, self._shorter(timeout_s))):
            if key.fileobj is self._awake:
                self._awake.recv(4096)
            elif key.fileobj is self._listener:
                self._accept()
            elif isinstance(key.data, Client):
                self._serve(key.data, events, frames)
        return frames

    def close(self) -> None:
        """Leave: clients see their connection end. May be called twice."""
        for client in tuple(self._clients.values()):
            self._drop(client, None)
        for each in (self._listener, self._awake, self._waker):
            if each is not None:
                each.close()
        self._selector.close()

    def cut(self) -> None:
        """Let the bus die: every connection ends, and no new one is taken."""
        if self._listener is not None:
            with suppress(KeyError):  # cut before
                self._selector.unregister(self._listener)
            self._listener.close()
            self._full_until_s = None
        for client in tuple(self._clients.values()):
            self._drop(client, None)

    def _shorter(self, timeout_s: float) -> float:
        """*timeout_s*, or less where a client must be looked at earlier."""
        now_s = monotonic()
        if self._full_until_s is not None:
            timeout_s = min(timeout_s, self._full_until_s - now_s)
        for client in self._clients.values():
            if client.held_until_s is not None:
                timeout_s = min(timeout_s, client.held_until_s - now_s)
            if client.out:
                timeout_s = min(timeout_s, client.progress_s + self._stall_s - now_s)
        return timeout_s

    @staticmethod
    def _acknowledge(client: Client) -> None:
        """Let the system acknowledge what *client* said, since no answer does."""
        client.unanswered = False
        if _QUICK_ACK is not None:
            with suppress(OSError):  # it has hung up
                client.connection.setsockopt(socket.IPPROTO_TCP, _QUICK_ACK, 1)

    def _listen(self, client: Client, read: bool) -> None:
        events = (selectors.EVENT_READ if read else 0) | (selectors.EVENT_WRITE if client.blocked else 0)
        if events == client.events:
            return
        if not events:
            self._selector.unregister(client.connection)
        elif not client.events:
            self._selector.register(client.connection, events, client)
        else:
            self._selector.modify(client.connection, events, client)
        client.events = events

    def _accept(self) -> None:
        assert self._listener is not None  # noqa: S101 - it just said that somebody calls
        try:
            connection, where = self._listener.accept()
        except OSError as failed:  # the caller has hung up already, or
            if failed.errno in _NO_ROOM:
                self._close_for_a_while(failed)
            return
        if len(self._clients) >= MOST_CLIENTS:
            self._tell(f"refused a client: {MOST_CLIENTS} are connected already")
            connection.close()
            return
        self._full_told = False
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_KEPT)  # or the system keeps megabytes
        client = self._clients[connection] = Client(connection, f"{where[0]}:{where[1]}")
        self._selector.register(connection, client.events, client)
        self._reply(client, HI)

    def _close_for_a_while(self, failed: OSError) -> None:
        """Let nobody in: who knocks would wake the thread again and again."""
        assert self._listener is not None  # noqa: S101 - it has just refused somebody
        if not self._full_told:
            self._full_told = True
            self._tell(f"cannot take another client: {failed.strerror}")
        self._selector.unregister(self._listener)
        self._full_until_s = monotonic() + _FULL_S

    def _open_again(self) -> None:
        if self._full_until_s is not None and self._listener is not None and self._full_until_s <= monotonic():
            self._full_until_s = None
            self._selector.register(self._listener, selectors.EVENT_READ)

    def _serve(self, client: Client, events: int, frames: list[tuple[Client, Frame]]) -> None:
        if events & selectors.EVENT_WRITE:
            client.blocked = False
        if not events & selectors.EVENT_READ:
            return
        try:
            data = client.connection.recv(_READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(client, None)
            return
        client.unanswered = True
        self._release(client)
        try:
            requests = client.requests.feed(data)
        except RubbishError as rubbish:
            self._drop(client, str(rubbish))
            return
        for request in requests:
            frame = self._obey(client, request)
            if frame is not None:
                frames.append((client, frame))

    def _obey(self, client: Client, request: bytes) -> Frame | None:
        """Do what *request* asks; the frame that it sends, if it is one."""
        if client.opened:
            try:
                frame = sent_frame(request)
            except ValueError as wrong:
                self._complain(client, request, SYNTAX, str(wrong))
                return None
            if frame is not None:
                return frame
        if not client.opened and opened_bus(request) is not None:
            client.opened = True
            self._reply(client, OK)
        elif client.opened and request in (b"rawmode", b"bcmmode"):
            client.raw = request == b"rawmode"
            self._reply(client, OK)
            client.held_until_s = monotonic() + HOLD_S
        elif client.opened and request == b"echo":
            self._reply(client, b"< echo >")
        else:
            self._complain(client, request, UNKNOWN, "no such request here")
        return None

    def _complain(self, client: Client, request: bytes, answer: bytes, why: str) -> None:
        """Refuse *request*; say so to the user once a client."""
        self._reply(client, answer)
        if not client.complained:
            client.complained = True
            self._tell(f"client {client.name} asked {request[:60]!r}: {why}")

    def _reply(self, client: Client, text: bytes) -> None:
        client.out.extend(text)
        if not client.blocked:
            self._send(client)

    def _release(self, client: Client) -> None:
        """Let frames follow: the client has read what had to come alone."""
        if client.held_until_s is not None:
            client.held_until_s = None
            client.out.extend(client.held)
            client.held.clear()

    def _flush(self) -> None:
        """Send what can be sent; drop who takes nothing."""
        now_s = monotonic()
        for client in tuple(self._clients.values()):
            if client.held_until_s is not None and client.held_until_s <= now_s:
                self._release(client)
            if not client.out:
                client.progress_s = now_s
            elif client.blocked and now_s - client.progress_s >= self._stall_s:
                self._drop(client, f"took nothing for {self._stall_s:g} s while frames waited for it")
            elif not client.blocked:
                self._send(client)

    def _send(self, client: Client) -> None:
        try:
            sent = client.connection.send(client.out)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._drop(client, None)
            return
        if sent:
            client.unanswered = False
            client.progress_s = monotonic()
            del client.out[:sent]
        client.blocked = bool(client.out)

    def _drop(self, client: Client, why: str | None) -> None:
        """End a connection, for the reason that the user is told where there is one."""
        if self._clients.pop(client.connection, None) is None:
            return
        if client.events:
            self._selector.unregister(client.connection)
        client.connection.close()
        if why is not None:
            self._tell(f"dropped client {client.name}: {why}")


def _listener(address: tuple[str, int]) -> socket.socket:
    family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
    listener = socket.create_server(address, family=family, backlog=MOST_CLIENTS)
    listener.setblocking(False)
    return listener
