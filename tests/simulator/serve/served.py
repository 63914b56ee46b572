"""`dvtcli sim` as a process of its own, and programs that attach to it."""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import can

from tests.harness.forked import Forked
from tests.process import PATIENCE_S, Ran, environment, run, start

#: how long a node may take to answer on a busy machine (s): a test of one that is silent says how long it waits
ANSWER_S = "20"


@dataclass
class Served:
    """Simulated nodes in another process; *folder* is the test's own."""

    process: Forked
    folder: Path
    port: int
    said: str = ""
    complaints: str = ""
    _attached: list[can.BusABC] = field(default_factory=list)

    def dvtcli(self, *words: str, stdin: str = "") -> Ran:
        """Run a second dvtcli on the nodes' bus."""
        return run([*bus_words(self.port), *words], stdin=stdin, env=own_environment(self.folder))

    def attach(self) -> can.BusABC:
        """python-can's own client."""
        bus = can.Bus(interface="socketcand", host="127.0.0.1", port=self.port, channel="can0", ignore_config=True)
        self._attached.append(bus)
        return bus

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal; the exit code. What was said is in `said` and `complaints` then."""
        for bus in self._attached:
            bus.shutdown()
        self._attached.clear()
        if self.process.poll() is None:
            self.process.send_signal(number)
        said, complaints = self.process.communicate(timeout=PATIENCE_S)
        self.said, self.complaints = self.said + said, self.complaints + complaints
        return self.process.returncode


def bus_words(port: int) -> list[str]:
    """The options by which dvtcli attaches."""
    words = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={port}"]
    return [*words, "--timeout", ANSWER_S]


def own_environment(folder: Path) -> dict[str, str]:
    """An environment in which locks and journals are *folder*'s."""
    state = str(folder / "state-home")
    return environment() | {"XDG_STATE_HOME": state, "LOCALAPPDATA": state}


def state_folder(folder: Path) -> Path:
    """Where dvtcli keeps locks and journals in that environment."""
    own = folder / "state-home" / "dvtcli"
    return own / "dvtcli" if os.name == "nt" else own  # Windows has a folder for whoever made it, too


@contextmanager
def served(folder: Path, *words: str, port: int = 0) -> Iterator[Served]:
    """`dvtcli sim` with *words* at *port* (0: a free one), from when it listens until the block ends."""
    ready = folder / f"ready-{time.monotonic_ns()}"
    words = ("sim", *words, "--listen", f"127.0.0.1:{port}", "--ready-file", str(ready))
    process = start(words, env=own_environment(folder))
    try:
        wait_for(lambda: ready.exists() or process.poll() is not None, "the nodes")
        if process.poll() is not None:
            raise AssertionError(process.communicate())
        server = Served(process, folder, int(ready.read_text("utf-8").rpartition(":")[2]))
        yield server
        server.end()
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


@contextmanager
def reserved_port() -> Iterator[int]:
    """A port for servers that come and go, which nobody else gets meanwhile, where the system can keep it."""
    with socket.socket() as held:
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        port: int = held.getsockname()[1]
        if sys.platform != "linux":  # elsewhere nobody listens at a port that somebody else has, though it is not used
            held.close()
        yield port


def wait_for(condition: object, what: str, patience_s: float = PATIENCE_S) -> None:
    """Wait until *condition*() holds."""
    assert callable(condition)
    until = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < until, f"{what}: not within {patience_s:.0f} s"
        time.sleep(0.01)


def raw_client(port: int, receive_buffer: int | None = None) -> socket.socket:
    """A socketcand client in raw mode, without any library."""
    client = socket.socket()
    if receive_buffer is not None:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    client.settimeout(PATIENCE_S)
    client.connect(("127.0.0.1", port))
    for request, answer in ((b"", b"< hi >"), (b"< open can0 >", b"< ok >"), (b"< rawmode >", b"< ok >")):
        client.sendall(request)
        assert client.recv(256) == answer
    return client


def received(bus: can.BusABC, wanted: int, patience_s: float = PATIENCE_S) -> list[can.Message]:
    """The next *wanted* frames on *bus*."""
    frames: list[can.Message] = []
    until = time.monotonic() + patience_s
    while len(frames) < wanted and time.monotonic() < until:
        frame = bus.recv(0.5)
        if frame is not None:
            frames.append(frame)
    return frames


def is_posix() -> bool:
    """Whether signals are those of POSIX."""
    return os.name == "posix"
