"""Killing a dvtcli at work on served nodes, at a frame of its own: before anything answers that frame.

Everybody speaks to the nodes through this process, which passes on what both sides say. Does not know what a frame
means.
"""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from select import select

import can

from tests.harness.forked import Forked
from tests.posix import SIGKILL
from tests.process import PATIENCE_S, start
from tests.simulator.serve.served import Served, bus_words, own_environment, served

#: what socketcand is told to send: CAN-ID, how many bytes, and the bytes
_SEND = re.compile(rb"< send ([0-9A-Fa-f]+) \d+ ?([^>]*)>")


@dataclass
class Killable(Served):
    """Served nodes behind a *door*, at which a dvtcli can be killed."""

    door: Door = field(kw_only=True)

    def killed(self, words: Sequence[str], at: int, which: Callable[[can.Message], bool]) -> int:
        """Run dvtcli with *words*, and kill it at the *at*-th frame of its own that *which* tells; its exit code.

        The nodes have heard that frame, and none that may have come behind it; nobody has heard an answer.
        """
        return self._ended(words, Victim(at, which))

    def cut_off(self, words: Sequence[str], at: int, which: Callable[[can.Message], bool]) -> int:
        """The same, and its connection ends there, as that of a server which is gone; dvtcli goes on to its end."""
        return self._ended(words, CutOff(at, which))

    def _ended(self, words: Sequence[str], victim: Victim) -> int:
        self.door.victim = victim
        victim.process = start([*bus_words(self.port), *words], env=own_environment(self.folder))
        victim.is_there.set()
        try:
            self.said, self.complaints = victim.process.communicate(timeout=PATIENCE_S)
        finally:
            victim.process.kill()
            self.door.victim = None
        return victim.process.returncode


@dataclass
class Victim:
    """Who is to be killed at the *left*-th frame from now on that *which* tells."""

    left: int
    which: Callable[[can.Message], bool]
    is_there: threading.Event = field(default_factory=threading.Event)
    process: Forked | None = None

    def falls_at(self, request: bytes) -> bool:
        """Whether *request* is that frame."""
        sent = _SEND.search(request)
        self.left -= sent is not None and self.which(_frame(sent))
        return self.left == 0

    def kill(self) -> None:
        """Kill it, and see it dead."""
        assert self.is_there.wait(PATIENCE_S)
        assert self.process is not None
        self.process.send_signal(SIGKILL)
        self.process.wait(PATIENCE_S)


class CutOff(Victim):
    """Who loses the bus at that frame."""

    def kill(self) -> None:
        """It lives on; the door ends its connection."""


@contextmanager
def killable(folder: Path, *words: str) -> Iterator[Killable]:
    """`dvtcli sim` with *words*, as `served` has it, behind a door."""
    with served(folder, *words) as nodes, Door(nodes.port) as door:
        yield Killable(nodes.process, folder, door.port, _attached=nodes._attached, door=door)


class Door:
    """A port through which all that is said to the server at *port* and by it goes."""

    def __init__(self, port: int) -> None:
        self._server = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self.victim: Victim | None = None
        #: where what comes from one end goes to; and of who came in what has come of a request that is not whole yet
        self._other: dict[socket.socket, socket.socket] = {}
        self._begun: dict[socket.socket, bytes] = {}
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work)

    def __enter__(self) -> Door:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self._thread.join()
        for end in (self._listening, *self._other):
            end.close()

    def _work(self) -> None:
        while not self._closing.is_set():
            for end in select([self._listening, *self._other], [], [], 0.02)[0]:
                if end is self._listening:
                    self._let_in()
                elif end in self._other:
                    self._pass_on(end, self._other[end])

    def _let_in(self) -> None:
        near, far = self._listening.accept()[0], socket.create_connection(("127.0.0.1", self._server))
        self._other |= {near: far, far: near}
        self._begun[near] = b""
        for end in (near, far):
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _pass_on(self, end: socket.socket, other: socket.socket) -> None:
        """Pass on what *end* said to the *other* one; the end of one ends both."""
        try:
            said = end.recv(1 << 16)
            if end in self._begun:
                self._pass_requests(end, other, said)
            else:
                other.sendall(said)
        except ConnectionError:
            said = b""
        if not said:
            self._end(end, other)

    def _pass_requests(self, end: socket.socket, other: socket.socket, said: bytes) -> None:
        *whole, self._begun[end] = (self._begun[end] + said).split(b">")
        for request in whole:
            other.sendall(request + b">")
            if self.victim is not None and self.victim.falls_at(request + b">"):
                self.victim.kill()
                self._end(end, other)
                return

    def _end(self, end: socket.socket, other: socket.socket) -> None:
        """Close both; a server has heard all that was said to it, since it sees the end behind that."""
        for gone in (end, other):
            self._other.pop(gone, None)
        if self._begun.pop(end, None) is not None:
            other.shutdown(socket.SHUT_WR)
            while other.recv(1 << 16):
                pass
        for gone in (end, other):
            gone.close()


def _frame(sent: re.Match[bytes]) -> can.Message:
    data = bytes(int(byte, 16) for byte in sent[2].split())
    return can.Message(arbitration_id=int(sent[1], 16), data=data, is_extended_id=False)
