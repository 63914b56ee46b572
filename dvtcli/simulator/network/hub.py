"""The connections to one bus over TCP or a Unix socket: accept clients, pass frames on, drop clients.

All methods but `wake` belong to one thread. No frame is lost: unread frames are kept. A sender faster than a reader
waits for the reader, and nobody else does; a client that reads nothing for `STALL_S`, or is megabytes behind, is
dropped. When all places are taken, the owner of the most connections loses one.
"""

from __future__ import annotations

import errno
import ipaddress
import os
import selectors
import socket
import stat
import struct
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.hub_client import LOOK_S, Client

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
#: connections that are taken at once, and that may wait for that: who knocks in vain keeps nobody else's knock away
_AT_ONCE, _BACKLOG = 64, 1024
_INTERNET = (socket.AF_INET, socket.AF_INET6)
#: host and port, or the path of a Unix socket
Address = tuple[str, int] | str
MayRead = Callable[[Client], bool]


class Hub:
    """Listens at *addresses* (host and port, 0 for a free port; or a path), or only waits if empty.

    *tell* takes one line about a client; a client that reads nothing for *stall_s* (s) is dropped. *admit* makes a
    client with its protocol from a connection; at most *most* are admitted. *may_come* decides about a user-ID of this
    machine, None if unknown. Raises OSError if an address is not available. Ends with `close`.
    """

    def __init__(
        self,
        addresses: Sequence[Address],
        tell: Callable[[str], None],
        stall_s: float = STALL_S,
        admit: type[Client] = Client,
        *,
        most: int = MOST_CLIENTS,
        may_come: Callable[[int | None], bool] | None = None,
    ) -> None:
        self._admit, self._most, self._may_come = admit, most, may_come
        self._tell = tell
        self._stall_s = stall_s
        self._selector = selectors.SelectSelector()  # the only selector with waits under a millisecond
        self._clients: dict[socket.socket, Client] = {}
        #: until when nobody is let in (s), None where clients may come; and whether the user was told
        self._full_until_s: float | None = None
        self._full_told = False
        #: the owners of the connections, while new clients are accepted
        self._whose: dict[Peer, str] = {}
        self._listeners: list[socket.socket] = []
        self._paths: list[str] = []
        #: the TCP ports in the order of the addresses
        self.ports: tuple[int, ...] = ()
        try:
            for address in addresses:
                self._add_listener(address)
        except BaseException:
            self._close_listeners()
            raise
        self._awake, self._waker = socket.socketpair()
        for each in (self._awake, self._waker):
            each.setblocking(False)
        self._selector.register(self._awake, selectors.EVENT_READ)
        self._listen_to_newcomers()

    def _add_listener(self, address: Address) -> None:
        if isinstance(address, str):
            self._listeners.append(_unix_listener(address))
            self._paths.append(address)
            return
        listener = _listener(address)
        self._listeners.append(listener)
        self.ports += (listener.getsockname()[1],)

    def _listen_to_newcomers(self) -> None:
        for listener in self._listeners:
            self._selector.register(listener, selectors.EVENT_READ)

    def _close_listeners(self) -> None:
        for listener in self._listeners:
            with suppress(KeyError, ValueError, AttributeError):  # not listened to now, or not yet
                self._selector.unregister(listener)
            listener.close()
        for path in self._paths:
            with suppress(OSError):  # somebody took it away
                os.unlink(path)  # noqa: PTH108
        self._listeners, self._paths = [], []

    @property
    def port(self) -> int | None:
        """The first TCP port, None without one."""
        return self.ports[0] if self.ports else None

    @property
    def clients(self) -> int:
        """The number of connected clients."""
        return len(self._clients)

    @property
    def connected(self) -> tuple[Client, ...]:
        """The clients in the order of connection."""
        return tuple(self._clients.values())

    def wake(self) -> None:
        """End a `wait`, from any thread or signal handler."""
        with suppress(OSError):  # already full of wake-ups, or closed
            self._waker.send(b"\0")

    def tell_all(self, text: bytes, source: object) -> None:
        """Queue *text* for every client in raw mode except *source*."""
        for client in self._clients.values():
            if client.raw and client is not source:
                client.put(text, source)

    def wait(self, timeout_s: float, may_read: MayRead) -> list[tuple[Client, Frame]]:
        """Send waiting data and return frames from clients, received within *timeout_s* (s) or at once if present.

        Reads only clients accepted by *may_read*, and no client that keeps too much waiting for a slow reader; the data
        of the others stays unread.
        """
        self._flush()
        self._open_again()
        slow = [client for client in self._clients.values() if client.queued_by_sender]
        for client in self._clients.values():
            self._listen(
                client, may_read(client) and all(each.queued_by_sender.get(client, 0) <= SHARE for each in slow)
            )
            if client.unanswered:
                client.acknowledge()
        frames: list[tuple[Client, Frame]] = []
        for key, events in self._selector.select(max(0.0, self._shorter(timeout_s))):
            if key.fileobj is self._awake:
                self._awake.recv(4096)
            elif key.fileobj in self._listeners:
                assert isinstance(key.fileobj, socket.socket)  # noqa: S101 - a listener
                self._accept(key.fileobj, frames)
            elif isinstance(key.data, Client):
                self._serve(key.data, events, frames)
        return frames

    def close(self) -> None:
        """Close all connections. May be called twice."""
        for client in tuple(self._clients.values()):
            self._drop(client, None)
        self._close_listeners()
        for each in (self._awake, self._waker):
            each.close()
        self._selector.close()

    def cut(self) -> None:
        """Fail the bus: end every connection and accept no new ones."""
        self._close_listeners()
        self._full_until_s = None
        for client in tuple(self._clients.values()):
            self._drop(client, None)

    def _shorter(self, timeout_s: float) -> float:
        """*timeout_s*, or less if a client must be checked earlier."""
        now_s = monotonic()
        if self._full_until_s is not None:
            timeout_s = min(timeout_s, self._full_until_s - now_s)
        for client in self._clients.values():
            if client.held_until_s is not None:
                timeout_s = min(timeout_s, client.held_until_s - now_s)
            if client.out:
                timeout_s = min(timeout_s, LOOK_S, client.last_sent_s + self._stall_s - now_s)
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

    def _accept(self, listener: socket.socket, frames: list[tuple[Client, Frame]]) -> None:
        """Accept all waiting connections, as far as allowed and there is room; refused clients block nobody.

        Adds *frames* already sent by clients if room had to be made.
        """
        came: list[tuple[socket.socket, Peer]] = []
        while len(came) < _AT_ONCE:
            try:
                connection, where = listener.accept()
            except BlockingIOError:
                break
            except OSError as failed:  # the caller has hung up already, or
                if failed.errno in _NO_ROOM:
                    self._close_for_a_while(failed)
                break
            connection.setblocking(False)
            came.append((connection, where[:2] if listener.family in _INTERNET else _unix_peer(connection)))
        if self._may_come is not None:
            came = self._allowed(came, self._may_come)
        peers = [peer for _, peer in came]
        for connection, peer in came:
            if len(self._clients) >= self._most:
                self._read_idle(frames)
            if len(self._clients) >= self._most:
                self._make_room(peer, peers)
            if len(self._clients) >= self._most:
                connection.close()
            else:
                self._take(connection, peer)
        self._whose = {}

    def _allowed(
        self, came: list[tuple[socket.socket, Peer]], may_come: Callable[[int | None], bool]
    ) -> list[tuple[socket.socket, Peer]]:
        """The new connections of allowed users; the others are closed and reported."""
        whose = users([(connection.getsockname(), peer) for connection, peer in came if _is_internet(connection)])
        allowed = []
        for connection, peer in came:
            user = whose.get(peer) if _is_internet(connection) else _unix_user(connection)
            if may_come(user):
                allowed.append((connection, peer))
                continue
            connection.close()
            why = "its owner is not known, or it has closed already" if user is None else f"it is user {user}"
            self._tell(f"refused client {_name(peer)}: {why}")
        return allowed

    def _take(self, connection: socket.socket, peer: Peer) -> None:
        self._full_told = False
        if _is_internet(connection):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)  # or the system keeps megabytes
        client = self._admit(connection, _name(peer), self._tell, peer=peer, last_received_s=monotonic())
        self._clients[connection] = client
        self._selector.register(connection, client.events, client)
        client.greet()
        self._drop_if_gone(client)

    def _read_idle(self, frames: list[tuple[Client, Frame]]) -> None:
        """Read clients without an open bus: they may have hung up, or opened the bus meanwhile."""
        for client in [client for client in self._clients.values() if not client.opened]:
            self._serve(client, selectors.EVENT_READ, frames)

    def _make_room(self, newcomer: Peer, newcomers: list[Peer]) -> None:
        """Drop the oldest client without an open bus to make room for *newcomer*.

        Otherwise drop the longest silent connection of the program or host with the most connections, if more than
        *newcomer*'s owner would have. Otherwise refuse the newcomer. Owners are looked up once for all *newcomers*.
        """
        idle = next((client for client in self._clients.values() if not client.opened), None)
        if idle is not None:
            self._drop(idle, f"it opened no bus, and {self._most} are connected")
            return
        if not self._whose:
            self._close_for(_CROWDED_S)
            self._whose = owners([*newcomers, *(client.peer for client in self._clients.values())], self.ports)
        whose = self._whose
        places = Counter(whose[client.peer] for client in self._clients.values())
        (greedy, most), own = places.most_common(1)[0], places[whose[newcomer]]
        if own + 1 < most:
            of_greedy = [client for client in self._clients.values() if whose[client.peer] == greedy]
            silent = min(of_greedy, key=lambda client: client.last_received_s)
            self._drop(silent, f"{greedy} has {most} of {self._most} places, and another program wants one")
        else:
            self._tell(f"refused a client: {self._most} are connected already, {own} of them of {whose[newcomer]}")

    def _close_for_a_while(self, failed: OSError) -> None:
        """Stop accepting for a while: new connections would wake the thread again and again."""
        if not self._full_told:
            self._full_told = True
            self._tell(f"cannot take another client: {failed.strerror}")
        self._close_for(_FULL_S)

    def _close_for(self, duration_s: float) -> None:
        if self._full_until_s is None:
            for listener in self._listeners:
                self._selector.unregister(listener)
        self._full_until_s = monotonic() + duration_s

    def _open_again(self) -> None:
        if self._full_until_s is not None and self._full_until_s <= monotonic():
            self._full_until_s = None
            self._listen_to_newcomers()

    def _serve(self, client: Client, events: int, frames: list[tuple[Client, Frame]]) -> None:
        if events & selectors.EVENT_WRITE:
            client.blocked = False
        if events & selectors.EVENT_READ:
            frames += ((client, frame) for frame in client.read())
            self._drop_if_gone(client)

    def _flush(self) -> None:
        """Send as much as possible; drop clients that read nothing."""
        now_s = monotonic()
        for client in tuple(self._clients.values()):
            client.flush(now_s, self._stall_s, MOST_KEPT)
            self._drop_if_gone(client)

    def _drop_if_gone(self, client: Client) -> None:
        if client.gone:
            self._drop(client, client.why)

    def _drop(self, client: Client, why: str | None) -> None:
        """End a connection; *why* is reported to the user, if given."""
        if self._clients.pop(client.connection, None) is None:
            return
        if client.events:
            self._selector.unregister(client.connection)
        client.connection.close()
        if why is not None:
            self._tell(f"dropped client {client.name}: {why}")


def _name(peer: Peer) -> str:
    """The name of a client at *peer*."""
    return f"{peer[0]}:{peer[1]}" if peer[1] else peer[0]


def _is_internet(connection: socket.socket) -> bool:
    return connection.family in _INTERNET


def _listener(address: tuple[str, int]) -> socket.socket:
    family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
    listener = socket.create_server(address, family=family, backlog=_BACKLOG)
    listener.setblocking(False)
    return listener


def _unix_listener(path: str) -> socket.socket:
    """A socket at *path* for connections of its user only; an abandoned socket is replaced.

    Raises OSError if another file is in its place, or a process is listening.
    """
    if sys.platform == "win32":
        raise OSError(errno.EOPNOTSUPP, "Windows has no Unix sockets here")
    listener = socket.socket(socket.AF_UNIX)
    try:
        try:
            listener.bind(path)
        except OSError as failed:
            if failed.errno != errno.EADDRINUSE or not _is_left_over(path):
                raise
            os.unlink(path)  # noqa: PTH108
            listener.bind(path)
        os.chmod(path, 0o600)  # noqa: PTH101 - before anybody can connect: nobody listens yet
        listener.listen(_BACKLOG)
        listener.setblocking(False)
    except BaseException:
        listener.close()
        raise
    return listener


def _is_left_over(path: str) -> bool:
    """True if *path* is a socket without a listener."""
    if sys.platform == "win32" or not stat.S_ISSOCK(os.lstat(path).st_mode):
        return False
    with socket.socket(socket.AF_UNIX) as probe:
        return probe.connect_ex(path) == errno.ECONNREFUSED


def _unix_peer(connection: socket.socket) -> Peer:
    """The process at the other end of a Unix socket's *connection*, if known to the system."""
    return f"process {process}" if (process := _credentials(connection)[0]) else "a process", 0


def _unix_user(connection: socket.socket) -> int | None:
    """The user-ID of the process at the other end of a Unix socket's *connection*, None if unknown."""
    return _credentials(connection)[1]


def _credentials(connection: socket.socket) -> tuple[int | None, int | None]:
    if sys.platform != "linux":
        return None, None
    process, user, _ = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
    return process, user


_TABLES = ("/proc/net/tcp", "/proc/net/tcp6")
#: columns of such a table: both ends as ADDRESS:PORT in hex, whose user's it is, and the socket's number
_FROM, _TO, _USER, _SOCKET = 1, 2, 7, 9
#: the number of a socket that its program has closed, of which Linux says user 0 whose ever it was
_CLOSED = "0"
#: host and port; of a Unix socket the process, and 0
Peer = tuple[str, int]


def users(connections: Iterable[tuple[Peer, Peer]]) -> dict[Peer, int]:
    """The user-ID of each peer on this machine, given both ends of its connection: ours, and the peer's.

    Leaves out unknown and already closed connections.
    """
    wanted = {(_plain(peer[0]), peer[1], _plain(own[0]), own[1]): peer for own, peer in connections}
    found: dict[Peer, int] = {}
    for columns in _rows() if wanted else ():
        ends = (*_end(columns[_FROM]), *_end(columns[_TO]))
        if ends in wanted:
            found[wanted[ends]] = int(columns[_USER])
    return found


def owners(peers: Iterable[Peer], at: Iterable[int]) -> dict[Peer, str]:
    """The owner in words of each of *peers* (host, port) connected to one of the ports *at* of this machine."""
    found = {peer: f"host {peer[0]}" if peer[1] else peer[0] for peer in peers}
    local = {peer[1]: peer for peer in found if _is_loopback(peer[0])}
    sockets = _sockets(local.keys(), at) if local else {}
    programs = _programs({number for number, _ in sockets.values()}) if sockets else {}
    for one, (number, user) in sockets.items():
        program = programs.get(number)
        found[local[one]] = f"user {user}" if program is None else f"process {program}"
    return found


def _is_loopback(host: str) -> bool:
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return False


def _sockets(ports: Iterable[int], at: Iterable[int]) -> dict[int, tuple[str, str]]:
    """Socket numbers and users of the connections from *ports* to one of the ports *at*."""
    wanted, found = {f"{port:04X}": port for port in ports}, {}
    ours = {f"{port:04X}" for port in at}
    for columns in _rows():
        one = wanted.get(columns[_FROM].rpartition(":")[2])
        if one is not None and columns[_TO].rpartition(":")[2] in ours:
            found[one] = columns[_SOCKET], columns[_USER]
    return found


def _rows() -> Iterator[list[str]]:
    """The columns of each TCP connection of this machine not yet closed by its program."""
    for table in _TABLES:
        with suppress(OSError):  # no Linux, or one without IPv6
            for line in Path(table).read_text("ascii").splitlines()[1:]:
                columns = line.split()
                if columns[_SOCKET] != _CLOSED:
                    yield columns


def _end(text: str) -> tuple[str, int]:
    """Address and port from such a table: words of 32 bits in the machine's byte order."""
    address, _, port = text.partition(":")
    words = bytes.fromhex(address)
    if sys.byteorder == "little":
        words = b"".join(words[at : at + 4][::-1] for at in range(0, len(words), 4))
    return _plain(str(ipaddress.ip_address(words))), int(port, 16)


def _plain(host: str) -> str:
    """An address in a normal form: an IPv4-mapped IPv6 address as IPv4."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    return str(getattr(address, "ipv4_mapped", None) or address)


def _programs(numbers: set[str]) -> dict[str, str]:
    """The process of each of the sockets *numbers*, if visible."""
    wanted, found = {f"socket:[{number}]": number for number in numbers}, {}
    for process in filter(str.isdecimal, os.listdir("/proc")):  # noqa: PTH208 - a name is all that is wanted
        folder = f"/proc/{process}/fd"
        with suppress(OSError):  # somebody else's, or it has ended
            for descriptor in os.listdir(folder):  # noqa: PTH208
                with suppress(OSError):
                    number = wanted.get(os.readlink(f"{folder}/{descriptor}"))  # noqa: PTH115
                    if number is not None:
                        found[number] = process
    return found
