"""Client of a socketcand server (https://github.com/linux-can/socketcand), as a python-can bus.

python-can's own client takes a closed connection for a silent bus, and wants the server's last answer alone in a read.
"""

from __future__ import annotations

import re
import select
import socket
from collections import deque
from contextlib import suppress
from math import inf
from time import monotonic, time
from typing import Any

import can

from dvtcli.bus.carrier import Carrier
from dvtcli.domain.cob_id import fits
from dvtcli.domain.hint import Hint

#: maximum time for a server to accept, and for each of its first answers (s): a system with no room for a connection
#: is asked again after 1 s, and after 3 s
CONNECT_S, ANSWER_S = 4.0, 10.0
#: time after which a server that takes no more data is lost (s)
SEND_S = 5.0
#: how often a waiting sender looks whether the bus was closed (s)
_LOOK_S = 0.2
#: A server whose machine or network is gone is noticed after some 20 s: time of silence before the first question, and
#: between questions (s), number of questions without an answer, and time for sent data without acknowledgement (ms),
#: during which the system asks no questions.
KEEP_ALIVE = {"TCP_KEEPIDLE": 10, "TCP_KEEPINTVL": 3, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 20_000}
#: maximum length of a server's message, and of what is quoted from it (characters)
_LONGEST, _QUOTED = 1000, 60
#: what may stand between messages
_BLANKS = " \t\r\n\0"
#: maximum number of bytes of one read
_READ = 1 << 16
_QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)
#: a data frame: CAN-ID, time (s; recordings have no longer ones) and data
_FRAME = re.compile(
    r"[\s\0]*frame\s+([0-9A-Fa-f]{1,8})\s+([0-9]{1,11}(?:\.[0-9]*)?)(?:\s([0-9A-Fa-f\s]*))?", re.ASCII
)  # fmt: skip
#: an error frame: the kernel's error class, and time (s), which some servers leave out
_ERROR = re.compile(
    r"[\s\0]*error\s+(?:([0-9A-Fa-f]{1,8})\s+([0-9]{1,11}(?:\.[0-9]*)?)|([0-9A-Fa-f]{8}))\s*", re.ASCII
)  # fmt: skip
#: maximum number of bytes in a frame
_MOST_DATA = 8
_BASE_DIGITS = 3


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
        #: why nothing can be sent or received any more
        self._failure: Exception | None = None
        self._open = True
        self._link = socket.create_connection((str(host), port), timeout=CONNECT_S)
        try:
            self._link.settimeout(ANSWER_S)
            self._begin(channel)
            self._link.setblocking(False)  # each wait is select's, with its own limit
            super().__init__(channel=channel, can_filters=can_filters, **settings)
        except BaseException:
            self._link.close()
            raise
        self._take("")  # frames may have come with the last answer

    def _begin(self, channel: str) -> None:
        """Greet the server, and ask for all frames of *channel*."""
        self._link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # the next request does not wait for an answer
        self._link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in KEEP_ALIVE.items():
            if hasattr(socket, name):
                self._link.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        self._expect("hi")
        for request in (f"open {channel}", "rawmode"):
            self._link.sendall(f"< {request} >".encode())
            self._expect("ok")

    def _expect(self, answer: str) -> None:
        """Read the server's next message; raise can.CanInitializationError if it is not *answer*."""
        received = self._next_answer()
        if not received.startswith("<") or received.strip("<>" + _BLANKS) != answer:
            raise can.CanInitializationError(f"expected '< {answer} >', got '{received[:_QUOTED]}'")

    def _next_answer(self) -> str:
        """Return the server's next message, or the beginning of other text. Raises TimeoutError after `ANSWER_S`."""
        end_s = monotonic() + ANSWER_S
        while ">" not in self._rest:
            begun = self._rest.lstrip(_BLANKS)
            if len(self._rest) > _LONGEST or (begun and begun[0] != "<"):
                return begun.rstrip(_BLANKS)
            left_s = end_s - monotonic()
            if left_s <= 0:
                raise TimeoutError(f"no whole answer within {ANSWER_S:g} s")
            self._link.settimeout(left_s)
            with suppress(TimeoutError):
                self._rest += self._received()
        received, _, self._rest = self._rest.partition(">")
        return f"{received.strip(_BLANKS)} >"

    def _received(self) -> str:
        """Text that the server sent. Raises BlockingIOError if none came, ConnectionResetError at its end."""
        data = self._link.recv(_READ)
        if not data:
            raise ConnectionResetError("the server has closed the connection")
        if self._quick_ack is not None:
            self._link.setsockopt(socket.IPPROTO_TCP, self._quick_ack, 1)
        return data.decode("latin-1")

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next message; None if none came within *timeout* (s; None: no limit).

        Raises ConnectionResetError if the server closed the connection, can.CanOperationError if the bus is closed or
        the server sent what is not a frame: after all frames that came before it or with it.
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
        self._require_open()
        try:
            if (wait_s is None or wait_s > 0) and not select.select([self._link], (), (), wait_s)[0]:
                return
            text = self._received()
        except BlockingIOError:
            return
        except (OSError, ValueError):
            self._require_open()  # else another thread closed it meanwhile
            raise
        self._take(text)

    def _require_open(self) -> None:
        if not self._open:
            raise can.CanOperationError("the bus is closed")
        if self._failure is not None:
            raise self._failure

    def _take(self, text: str) -> None:
        """Take the frames in *text*; answers and unknown messages are ignored, other text fails later reads."""
        *parts, self._rest = (self._rest + text).split(">")
        for part in parts:
            try:
                message = self._message(part)
            except ValueError:
                self._fail(f"the server sent what is not a frame: {part.strip()[:_QUOTED]!r}")
                continue
            if message is not None and (self._filters is None or self._matches_filters(message)):
                self._messages.append(message)
        if len(self._rest) > _LONGEST:
            self._fail(f"the server sent what is not a message: {self._rest[:_QUOTED]!r}")

    def _fail(self, why: str) -> None:
        if self._failure is None:
            self._failure = can.CanOperationError(why)

    def _message(self, part: str) -> can.Message | None:
        """The data frame or error frame in *part*, a message without its end; None for another message.

        Raises ValueError for what is not a frame.
        """
        text = part[part.rfind("<") + 1 :]
        if found := _FRAME.fullmatch(text):
            digits, time_s, words = found.groups("")
            can_id, is_extended, data = int(digits, 16), len(digits) != _BASE_DIGITS, _data(words.split())
            if len(data) > _MOST_DATA or not fits(can_id, extended=is_extended):
                raise ValueError
            return can.Message(float(time_s), can_id, is_extended, channel=self.channel, data=data)
        if found := _ERROR.fullmatch(text):
            timed, time_s, untimed = found.groups()
            return can.Message(
                timestamp=float(time_s) if time_s else time(), arbitration_id=int(timed or untimed, 16) & 0x1FFF_FFFF,
                is_error_frame=True, channel=self.channel, data=bytearray(1),
            )  # fmt: skip
        if text.lstrip(_BLANKS).split(maxsplit=1)[:1] == ["frame"]:
            raise ValueError
        return None

    def may_have_messages(self) -> bool:
        """Whether a message, an error or the end of the connection may be waiting."""
        if self._messages or self._failure is not None:
            return True
        try:
            self._link.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except OSError:  # a read raises it, too, and reports it
            return True
        return True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 - python-can's signature
        """Send a data frame; *timeout* is ignored.

        Raises ConnectionAbortedError if the server takes no data for `SEND_S`, OSError if the connection is lost,
        can.CanOperationError if the bus is closed or for a remote frame.
        """
        if msg.is_remote_frame:
            raise can.CanOperationError("socketcand sends no remote frames")
        can_id = f"{msg.arbitration_id:08X}" if msg.is_extended_id else f"{msg.arbitration_id:03X}"
        left, end_s = f"< send {can_id} {msg.dlc:X} {msg.data.hex(' ')} >".encode(), monotonic() + SEND_S
        while left:
            self._require_open()
            try:
                left = left[self._link.send(left) :]
            except BlockingIOError:
                self._wait_for_room(end_s)
            except OSError:
                self._require_open()  # else another thread closed it meanwhile
                raise

    def _wait_for_room(self, end_s: float) -> None:
        """Wait until the server takes data, or look again soon; after *end_s* (time.monotonic) the connection fails."""
        left_s = end_s - monotonic()
        if left_s <= 0:  # a part of a message may be sent, so that what follows would be no message
            self._failure = ConnectionAbortedError(f"the server has taken no data for {SEND_S:g} s")
            raise self._failure
        with suppress(ValueError):  # closed meanwhile
            select.select((), [self._link], (), min(left_s, _LOOK_S))

    def shutdown(self) -> None:
        """Close the connection; threads that wait for it get can.CanOperationError."""
        super().shutdown()
        self._open = False
        with suppress(OSError):
            self._link.shutdown(socket.SHUT_RDWR)
        self._link.close()


def _data(words: list[str]) -> bytearray:
    """The data in hexadecimal *words*: one word, or bytes, perhaps without leading zeros. Raises ValueError."""
    if len(words) == 1 and len(words[0]) > 2:
        return bytearray.fromhex(words[0])
    if any(len(word) > 2 for word in words):
        raise ValueError
    return bytearray(int(word, 16) for word in words)


class ServerCarrier(Carrier):
    """The connection of *bus* to its server."""

    def __init__(self, bus: SocketcandBus) -> None:
        self._bus = bus

    def may_have_frames(self) -> bool:
        """Whether frames, an error or the end of the connection may be waiting."""
        return self._bus.may_have_messages()

    def next_step(self, error: Exception) -> Hint | str:
        """Advice after *error* of sending or receiving."""
        if isinstance(error, TimeoutError):
            return "no answer from there: check the network, and whether the server is still running"
        return "is the server still running?"
