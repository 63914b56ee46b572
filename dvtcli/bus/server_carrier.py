"""A connection to a socketcand server as what carries a bus. Does not know who the server is, nor CANopen."""

from __future__ import annotations

import select
import socket
from collections.abc import Mapping

import can

from dvtcli.bus.carrier import Carrier

#: how long a server may take to accept (s): a system with no room for a connection is asked again after 1 s, and after
#: 3 s; python-can itself would try for 10 s, in a busy loop
PROBE_S = 4.0
#: a server whose machine is gone, or a way to it, is noticed after some 20 s without a sign of it: how long nothing has
#: to come before it is asked (s), how often (s), and how many questions have to be left without an answer
_KEEP_ALIVE = (("TCP_KEEPIDLE", 10), ("TCP_KEEPINTVL", 3), ("TCP_KEEPCNT", 3))


def probe(config: Mapping[str, object]) -> None:
    """Raise OSError where no server listens at the host and port of *config*, ValueError where it names none."""
    port = config.get("port")
    if not isinstance(port, int) or "host" not in config:
        raise ValueError("socketcand needs a host and a port")
    socket.create_connection((str(config["host"]), port), timeout=PROBE_S).close()


class ServerCarrier(Carrier):
    """The connection of python-can's *bus*, whose driver takes a closed one for a silent bus, in a busy loop."""

    def __init__(self, bus: can.BusABC) -> None:
        link = getattr(bus, "_SocketCanDaemonBus__socket", None)  # it has no other name: no fileno(), no property
        self._link = link if isinstance(link, socket.socket) else None
        if self._link is not None:
            self._link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for name, value in _KEEP_ALIVE:
                if hasattr(socket, name):
                    self._link.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)

    def hung_up(self) -> bool:
        """Whether the server closed the connection."""
        link = self._link
        return link is not None and bool(select.select([link], [], [], 0)[0]) and not link.recv(1, socket.MSG_PEEK)
