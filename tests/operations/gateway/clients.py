"""Other programs at a gateway: one that says lines, and canopen, whose SDO client says lines instead of frames."""

from __future__ import annotations

import re
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count

from canopen import Network, ObjectDictionary, RemoteNode
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError

from dvtcli.domain.gateway_words import Dialect
from dvtcli.domain.hint import Hint
from dvtcli.operations.gateway.serve_gateway import Gateway, gateway
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.operations.user.session_user import NullReporter
from tests.process import PATIENCE_S
from tests.virtual_time import VirtualTimeBus


class Heard(NullReporter):
    """Keeps what is said to the user."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def note(self, text: Hint | str) -> None:
        """Keep it."""
        self.said.append(str(text))

    warning = note


def _session(options: Options, reporter: Heard, *, in_virtual_time: bool) -> Session:
    session = Session(options, reporter)
    if in_virtual_time:
        session.simulate = partial(VirtualTimeBus, name="sim")
    return session


@contextmanager
def served(
    *sim: str,
    allow_changes: bool = True,
    dialect: Dialect = Dialect.HASH,
    reporter: Heard | None = None,
    dry_run: bool = False,
    in_virtual_time: bool = False,
    any_user: bool = False,
) -> Iterator[tuple[Session, Gateway]]:
    """A session on simulated nodes, and its gateway, which runs in a thread."""
    options = Options(sim=sim, yes=True, dry_run=dry_run)
    with (
        _session(options, reporter or Heard(), in_virtual_time=in_virtual_time) as session,
        gateway(session, ("127.0.0.1", 0), allow_changes=allow_changes, any_user=any_user, dialect=dialect) as running,
    ):
        failed: list[BaseException] = []

        def run() -> None:
            try:
                running.run()
            except BaseException as fault:
                failed.append(fault)
                raise

        thread = threading.Thread(target=run, name="gateway")
        thread.start()
        try:
            yield session, running
        finally:
            running.stop()
            thread.join(PATIENCE_S)
        assert not failed
        assert not thread.is_alive()


class Client:
    """A socket that says lines; what comes without being asked is kept."""

    def __init__(self, running: Gateway, path: str | None = None) -> None:
        if path is None:
            assert running.hub.port is not None
            self.link = socket.create_connection(("127.0.0.1", running.hub.port), timeout=PATIENCE_S)
        else:
            self.link = socket.socket(socket.AF_UNIX)
            self.link.settimeout(PATIENCE_S)
            self.link.connect(path)
        self._file = self.link.makefile("r", encoding="ascii", newline="\n")
        self.events: list[str] = []
        self._numbers = count(1)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
        self.link.close()

    def say(self, data: bytes) -> None:
        """Send *data* as it is."""
        self.link.sendall(data)

    def is_answered(self) -> bool:
        """Whether anything came that was not read yet."""
        return bool(select.select([self.link], [], [], 0)[0])

    def line(self) -> str:
        """The next line, empty where the connection ended."""
        with suppress(ConnectionError):
            return self._file.readline().rstrip("\r\n")
        return ""

    def reply(self) -> str:
        """The next line that is no event, empty where the connection ended."""
        while (came := self.line()) and not came.startswith("["):
            self.events.append(came)
        return came

    def wait(self, event: str) -> None:
        """Wait for an event, which may have come before the last answer."""
        while event not in self.events:
            came = self.line()
            assert came, "the connection ended"
            self.events.append(came)

    def answer(self, line: str) -> str:
        """The answer to a *line* that has its sequence number, without that."""
        self.say(f"{line}\r\n".encode())
        number = re.match(r"\[(\d+)\]", line)
        assert number is not None
        while True:
            came = self.line()
            assert came, "the connection ended"
            if came.startswith(f"[{number[1]}] "):
                return came.removeprefix(f"[{number[1]}] ")
            self.events.append(came)

    def ask(self, words: str) -> str:
        """The answer to *words* with a number of our own."""
        return self.answer(f"[{next(self._numbers)}] {words}")

    def execute(self, text: str) -> list[str]:
        """Say every line of a file that is no comment; the answers."""
        return [self.answer(line) for line in text.splitlines() if line.startswith("[")]


class BridgedSdo(SdoClient):
    """canopen's SDO client, which asks a gateway."""

    def __init__(self, client: Client, node_id: int, dictionary: ObjectDictionary) -> None:
        super().__init__(0x600 + node_id, 0x580 + node_id, dictionary)
        self._client, self._node_id = client, node_id

    def upload(self, index: int, subindex: int) -> bytes:
        """Read by a line."""
        return bytes.fromhex(self._asked(f"r 0x{index:04X} {subindex} hex"))

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:
        """Write by a line."""
        del force_segment
        self._asked(f"w 0x{index:04X} {subindex} hex {data.hex()}")

    def _asked(self, words: str) -> str:
        answer = self._client.ask(f"{self._node_id} {words}")
        failed = re.match(r"ERROR:\s*(0x\w+|\d+)", answer)
        if failed is not None:
            raise SdoAbortedError(int(failed[1], 0))
        return answer


class BridgedNode(RemoteNode):
    """canopen's node behind a gateway."""

    def __init__(self, client: Client, node_id: int, dictionary: ObjectDictionary) -> None:
        self._client, self._node_id = client, node_id
        super().__init__(node_id, dictionary)
        self.associate_network(Network())  # nothing is sent there

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> BridgedSdo:
        """Its one SDO channel, which is the gateway's."""
        del rx_cobid, tx_cobid
        channel = BridgedSdo(self._client, self._node_id, self.object_dictionary)
        self.sdo_channels.append(channel)
        return channel
