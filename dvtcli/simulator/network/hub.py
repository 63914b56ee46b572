"""Who is connected to one bus over TCP: lets clients in, waits for them, passes frames on, drops them.

One thread calls everything but `wake`. Loses no frame: what a client does not read yet is kept. Who sends faster than
another one reads waits for it, and nobody else does; one that takes nothing for `STALL_S`, or is megabytes behind, is
dropped. Where all places are taken whoever has most of them gives one away. Does not know nodes or bit rates.
"""

from __future__ import annotations

import errno
import selectors
import socket
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from time import monotonic

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.hub_client import LOOK_S, Client
from dvtcli.simulator.network.hub_owners import owners

#: how long a client may take nothing while something waits for it (s)
STALL_S = 5.0
#: clients at once
MOST_CLIENTS = 64
#: what the system may keep for a client, what another client may let wait besides before it is read again, and what
#: waits at most (bytes; a frame is some 45)
_SEND_BUFFER, SHARE, MOST_KEPT = 256 * 1024, 64 * 1024, 8 << 20
#: how long nobody is let in after the system had no room for a client (s)
_FULL_S = 1.0
#: the same after it was looked up whose the connections are, which takes some milliseconds (s)
_CROWDED_S = 0.1
_NO_ROOM = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
Peer = tuple[str, int]
MayRead = Callable[[Client], bool]


class Hub:
    """Listens at *address* (host, port; port 0 is a free one), or only waits where that is None.

    *tell* takes one line about a client; one that takes nothing for *stall_s* is dropped. *admit* makes a client, which
    speaks its own protocol, of a connection. OSError where the address is not to be had. Ends with `close`.
    """

    def __init__(
        self,
        address: tuple[str, int] | None,
        tell: Callable[[str], None],
        stall_s: float = STALL_S,
        admit: type[Client] = Client,
    ) -> None:
        self._admit = admit
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
    def connected(self) -> tuple[Client, ...]:
        """The clients, who came first first."""
        return tuple(self._clients.values())

    def wake(self) -> None:
        """End a `wait`, from any thread or signal handler."""
        with suppress(OSError):  # it is full of wake-ups already, or closed
            self._waker.send(b"\0")

    def tell_all(self, text: bytes, source: object) -> None:
        """Put *text* on its way to every client in raw mode but *source*."""
        for client in self._clients.values():
            if client.raw and client is not source:
                client.put(text, source)

    def wait(self, timeout_s: float, may_read: MayRead) -> list[tuple[Client, Frame]]:
        """Send what waits, then the frames that clients sent within *timeout_s* (s), at once if there are some.

        Only clients for which *may_read* holds are read, and none that let too much wait for a slow one; the others
        keep what they say.
        """
        self._flush()
        self._open_again()
        slow = [client for client in self._clients.values() if client.owed]
        for client in self._clients.values():
            self._listen(client, may_read(client) and all(each.owed.get(client, 0) <= SHARE for each in slow))
            if client.unanswered:
                client.acknowledge()
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
                timeout_s = min(timeout_s, LOOK_S, client.progress_s + self._stall_s - now_s)
        return timeout_s

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
            self._make_room(where[:2])
        if len(self._clients) >= MOST_CLIENTS:
            connection.close()
            return
        self._full_told = False
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)  # or the system keeps megabytes
        client = self._admit(connection, f"{where[0]}:{where[1]}", self._tell, peer=where[:2], said_s=monotonic())
        self._clients[connection] = client
        self._selector.register(connection, client.events, client)
        client.greet()
        self._drop_if_gone(client)

    def _make_room(self, newcomer: Peer) -> None:
        """Drop who came first of those that only hold a place: they opened no bus yet.

        Else one of the program, or host, that has most connections, if it has more than that of *newcomer* would have:
        the one that was silent longest. Else the newcomer is refused.
        """
        idle = next((client for client in self._clients.values() if not client.opened), None)
        if idle is not None:
            self._drop(idle, f"it opened no bus, and {MOST_CLIENTS} are connected")
            return
        assert self.port is not None  # noqa: S101 - somebody has come
        self._close_for(_CROWDED_S)
        whose = owners([newcomer, *(client.peer for client in self._clients.values())], self.port)
        places = Counter(whose[client.peer] for client in self._clients.values())
        (greedy, most), own = places.most_common(1)[0], places[whose[newcomer]]
        if own + 1 < most:
            of_greedy = [client for client in self._clients.values() if whose[client.peer] == greedy]
            silent = min(of_greedy, key=lambda client: client.said_s)
            self._drop(silent, f"{greedy} has {most} of {MOST_CLIENTS} places, and another program wants one")
        else:
            self._tell(f"refused a client: {MOST_CLIENTS} are connected already, {own} of them of {whose[newcomer]}")

    def _close_for_a_while(self, failed: OSError) -> None:
        """Let nobody in: who knocks would wake the thread again and again."""
        if not self._full_told:
            self._full_told = True
            self._tell(f"cannot take another client: {failed.strerror}")
        self._close_for(_FULL_S)

    def _close_for(self, duration_s: float) -> None:
        assert self._listener is not None  # noqa: S101 - it has just let somebody in, or not
        self._selector.unregister(self._listener)
        self._full_until_s = monotonic() + duration_s

    def _open_again(self) -> None:
        if self._full_until_s is not None and self._listener is not None and self._full_until_s <= monotonic():
            self._full_until_s = None
            self._selector.register(self._listener, selectors.EVENT_READ)

    def _serve(self, client: Client, events: int, frames: list[tuple[Client, Frame]]) -> None:
        if events & selectors.EVENT_WRITE:
            client.blocked = False
        if events & selectors.EVENT_READ:
            frames += ((client, frame) for frame in client.read())
            self._drop_if_gone(client)

    def _flush(self) -> None:
        """Send what can be sent; drop who takes nothing."""
        now_s = monotonic()
        for client in tuple(self._clients.values()):
            client.flush(now_s, self._stall_s, MOST_KEPT)
            self._drop_if_gone(client)

    def _drop_if_gone(self, client: Client) -> None:
        if client.gone:
            self._drop(client, client.why)

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
