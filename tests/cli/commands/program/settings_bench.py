"""dvtcli on a served node, by a settings file: what it ends with, and whether anything reached the node's bus."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.process import PATIENCE_S, documents, environment, run
from tests.simulator.serve.served import ANSWER_S, served

#: why nobody can be somebody else here; empty where it can be
WHY_NOT = "" if os.name == "posix" and os.geteuid() == 0 and shutil.which("setpriv") else "needs root and setpriv"
#: a user-ID that belongs to nobody here
STRANGER = 12345


def as_user(user: int | None) -> list[str]:
    """The words before a command that runs it as *user* with that user's own group and no other.

    It may read everything, since this Python may be kept where only root looks; that changes nobody's ownership.
    """
    if user is None:
        return []
    words = [f"--reuid={user}", f"--regid={user}", "--clear-groups"]
    return ["setpriv", *words, "--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"]


class Relay:
    """A port on loopback that hands on to the server at *target*, and counts the *visitors*."""

    def __init__(self, target: int) -> None:
        self.visitors = 0
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self) -> Relay:
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()

    def _serve(self) -> None:
        while True:
            try:
                visitor, _ = self._listener.accept()
            except OSError:
                return  # the test has ended
            self.visitors += 1
            threading.Thread(target=self._hand_on, args=(visitor,), daemon=True).start()

    def _hand_on(self, visitor: socket.socket) -> None:
        with visitor, socket.create_connection(("127.0.0.1", self._target)) as server:
            back = threading.Thread(target=_copy, args=(server, visitor), daemon=True)
            back.start()
            _copy(visitor, server)
            back.join()


def _copy(one: socket.socket, other: socket.socket) -> None:
    """Hand on until *one* has nothing more to say, or *other* is gone; then the other one hears that."""
    with contextlib.suppress(OSError):  # a program that ends may cut its line
        while data := one.recv(4096):
            other.sendall(data)
    with contextlib.suppress(OSError):
        other.shutdown(socket.SHUT_RDWR)


@dataclass
class Place:
    """A folder with a home, a repository in it, and a node behind a relay that counts who comes."""

    folder: Path
    relay: Relay
    variables: dict[str, str] = field(default_factory=dict)

    @property
    def home(self) -> Path:
        """The user's home; what is above it is nobody's business."""
        return self.folder / "home"

    @property
    def project(self) -> Path:
        """The root of a repository below the home."""
        return self.home / "project"

    @property
    def below(self) -> Path:
        """A folder of the repository, in which dvtcli runs."""
        return self.project / "a" / "b"

    @property
    def bus(self) -> str:
        """Lines of a settings file that choose the node's bus."""
        return (
            f'interface = "socketcand"\nchannel = "can0"\nbus_kwargs = ["host=127.0.0.1", "port={self.relay.port}"]\n'
        )

    def run(
        self, *words: str, cwd: Path | None = None, user: int | None = None, stdin: str = "", **variables: str
    ) -> subprocess.CompletedProcess[str]:
        """Run dvtcli below the repository, also as another *user* with that user's own group and no other."""
        env = environment() | {"HOME": str(self.home)} | self.variables | variables
        if user is None:
            return run(words, stdin=stdin, cwd=cwd or self.below, env=env)
        return subprocess.run(
            [*as_user(user), sys.executable, "-m", "dvtcli", *words],
            input=stdin, capture_output=True, encoding="utf-8", cwd=cwd or self.below,
            env=env | {"PYTHONDONTWRITEBYTECODE": "1"}, timeout=PATIENCE_S, check=False,
        )  # fmt: skip

    def give(self, owner: int) -> None:
        """Make home and all below it *owner*'s."""
        for path in (self.home, *self.home.rglob("*")):
            os.chown(path, owner, owner, follow_symlinks=False)

    def read(self, *words: str, **more: Any) -> int:
        """The vendor-ID that the chosen node says."""
        ran = self.run("-n", "1", "--json", "--timeout", ANSWER_S, *words, "read", "1018:1", **more)
        assert ran.returncode == 0, ran.stderr + ran.stdout
        value = documents(ran.stdout)[0]["value"]
        assert isinstance(value, int)
        return value

    def refused(self, *words: str, code: int = 6, error: str = "safety", **more: Any) -> dict[str, Any]:
        """The error with which a command ends that would have needed the bus; nobody came to the bus."""
        before = self.relay.visitors
        ran = self.run("-n", "1", "--json", *(words or ("read", "1018:1")), **more)
        assert ran.returncode == code, ran.stderr + ran.stdout
        document, *_ = documents(ran.stdout)
        assert (document["exit_code"], document["error"], document["state"]) == (code, error, "unchanged")
        assert self.relay.visitors == before, "something was sent"
        return document


@contextmanager
def place(tmp_path: Path) -> Iterator[Place]:
    """A place that other users can reach, too, unlike pytest's own folders."""
    folder = Path(tempfile.mkdtemp(prefix="dvtcli-trust-"))
    folder.chmod(0o755)
    try:
        with served(tmp_path, "gen4@1") as server, Relay(server.port) as relay:
            found = Place(folder, relay)
            found.below.mkdir(parents=True)
            (found.project / ".git").mkdir()
            for path in (found.home, *found.home.rglob("*")):
                path.chmod(0o755)
            yield found
    finally:
        shutil.rmtree(folder, ignore_errors=True)
