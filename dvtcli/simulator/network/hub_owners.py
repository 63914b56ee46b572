"""Find the owner of a connection: a program on this machine, as far as Linux shows, else the remote host.

Reads /proc on demand only.
"""

from __future__ import annotations

import ipaddress
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

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
