"""Client of a socketcand server (https://github.com/linux-can/socketcand), as a python-can bus.

python-can's own client takes a closed connection for a silent bus, wants the server's last answer alone in a read, and
takes three times the processor time for a frame.
"""

from __future__ import annotations

import select
import socket
from collections import deque
from math import inf
from time import monotonic
from typing import Any

import can

from dvtcli.bus.carrier import Carrier

#: how long a server may take to accept, and for each of its first answers (s): a system with no room for a connection
#: is asked again after 1 s, and after 3 s
CONNECT_S, ANSWER_S = 4.0, 10.0
#: a server whose machine is gone, or a way to it, is noticed after some 20 s without a sign of it: how long nothing has
#: to come before it is asked (s), how often (s), and how many questions have to be left without an answer
_KEEP_ALIVE = (("TCP_KEEPIDLE", 10), ("TCP_KEEPINTVL", 3), ("TCP_KEEPCNT", 3))
#: no message of a server is longer (characters)
_LONGEST = 1000
#: maximum number of bytes in a frame, and of one read
_MOST_DATA, _READ = 8, 1 << 16
#: flag of a receive that does not wait; None if this system has none
_AT_ONCE: int | None = getattr(socket, "MSG_DONTWAIT", None)
_QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)


class SocketcandBus(can.BusABC):
    """The bus *channel* of the server at *host* and *port*.

    *tcp_tune* acknowledges each packet immediately, for servers that wait for it. Raises OSError if the server is not
    reached or closes the connection, TimeoutError if it does not answer, can.CanInitializationError if it refuses.
    """

    def __init__(
        self,
        channel: str,
        host: str | None = None,
        port: int | None = None,
        tcp_tune: bool = False,
        can_filters: can.typechecking.CanFilters | None = None,
        **settings: Any,
    ) -> None:
        if host is None or not isinstance(port, int):
            raise ValueError("socketcand needs a host and a port")
        self.channel = channel
        self.channel_info = f"socketcand on {channel}@{host}:{port}"
        self._quick_ack = _QUICK_ACK if tcp_tune else None
        self._messages: deque[can.Message] = deque()
        #: the beginning of a message whose end was not received yet
        self._rest = ""
        self._open = True
        self._link = socket.create_connection((str(host), port), timeout=CONNECT_S)
        try:
            self._link.settimeout(ANSWER_S)
            self._begin(channel)
            self._link.settimeout(None)
        except BaseException:
            self._link.close()
            raise
        super().__init__(channel=channel, can_filters=can_filters, **settings)
        self._take("")

    def _begin(self, channel: str) -> None:
        """Greet the server, and ask for all frames of *channel*."""
        self._link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # the next request does not wait for an answer
        self._link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _KEEP_ALIVE:
            if hasattr(socket, name):
                self._link.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        self._expect("hi")
        for request in (f"open {channel}", "rawmode"):
            self._link.sendall(f"< {request} >".encode())
            self._expect("ok")

    def _expect(self, answer: str) -> None:
        """Read the server's next message; raise can.CanInitializationError if it is not *answer*."""
        while ">" not in self._rest:
            self._rest += self._received(0)
        received, _, self._rest = self._rest.partition(">")
        if received.strip("< \r\n\0") != answer:
            raise can.CanInitializationError(f"expected '< {answer} >', got '{received.strip()} >'")

    def _received(self, flags: int) -> str:
        """Text that the server sent. Raises BlockingIOError if none came, ConnectionResetError at its end."""
        data = self._link.recv(_READ, flags)
        if not data:
            raise ConnectionResetError("the server has closed the connection")
        if self._quick_ack is not None:
            self._link.setsockopt(socket.IPPROTO_TCP, self._quick_ack, 1)
        return data.decode("latin-1")

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next message; None if none came within *timeout* (s; None: no limit).

        Raises ConnectionResetError if the server closed the connection, can.CanOperationError if the bus is closed or
        the server sent what is no frame.
        """
        if not self._messages:
            end_s = inf if timeout is None else monotonic() + timeout
            self._read(timeout)
            while not self._messages:
                left_s = end_s - monotonic()
                if left_s <= 0:
                    return None
                self._read(None if left_s == inf else left_s)
        return self._messages.popleft()

    def _read(self, wait_s: float | None) -> None:
        """Read what comes first within *wait_s*."""
        if not self._open:
            raise can.CanOperationError("the bus is closed")
        flags = 0
        if wait_s is not None and wait_s <= 0 and _AT_ONCE is not None:
            flags = _AT_ONCE
        elif not select.select([self._link], (), (), wait_s)[0]:
            return
        try:
            text = self._received(flags)
        except BlockingIOError:
            return
        self._take(text)

    def _take(self, text: str) -> None:
        """Take the frames in *text*; answers and unknown messages are ignored."""
        *parts, self._rest = (self._rest + text).split(">")
        for part in parts:
            message = self._message(part)
            if message is not None and (self._filters is None or self._matches_filters(message)):
                self._messages.append(message)
        if len(self._rest) > _LONGEST:
            raise can.CanOperationError(f"the server sent what is no message: {self._rest[:40]!r}")

    def _message(self, part: str) -> can.Message | None:
        """The data frame or error frame in *part*, a message without its end; None for another message."""
        kind, *words = part[part.rfind("<") + 1 :].split() or ("",)
        is_error = kind == "error"
        if not is_error and kind != "frame":
            return None
        try:
            data = bytearray(1) if is_error else bytearray.fromhex("".join(words[2:]))
            if len(data) > _MOST_DATA:
                raise ValueError
            return can.Message(
                float(words[1]), int(words[0], 16) & 0x1FFFFFFF, is_error or len(words[0]) != 3, False, is_error,
                self.channel, data=data,
            )  # fmt: skip
        except (ValueError, IndexError) as error:
            if is_error:  # an error in words
                return None
            raise can.CanOperationError(f"the server sent what is no frame: {part.strip()!r}") from error

    def may_have_messages(self) -> bool:
        """Whether a message, an error or the end of the connection may be waiting."""
        if self._messages or _AT_ONCE is None:
            return True
        try:
            self._link.recv(1, _AT_ONCE | socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except OSError:  # a read raises it, too, and reports it
            return True
        return True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 - python-can's signature
        """Send a data frame; *timeout* is ignored. Raises OSError, can.CanOperationError for a remote frame."""
        if msg.is_remote_frame:
            raise can.CanOperationError("socketcand sends no remote frames")
        can_id = f"{msg.arbitration_id:08X}" if msg.is_extended_id else f"{msg.arbitration_id:03X}"
        self._link.sendall(f"< send {can_id} {msg.dlc:X} {msg.data.hex(' ')} >".encode())

    def shutdown(self) -> None:
        """Close the connection."""
        super().shutdown()
        self._open = False
        self._link.close()


class ServerCarrier(Carrier):
    """The connection of *bus* to its server."""

    def __init__(self, bus: SocketcandBus) -> None:
        self._bus = bus

    def may_have_frames(self) -> bool:
        """Whether frames, an error or the end of the connection may be waiting."""
        return self._bus.may_have_messages()
