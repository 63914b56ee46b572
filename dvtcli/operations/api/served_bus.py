"""Simulated nodes served on loopback from this process, for other programs and for tests. Prints nothing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from dvtcli.operations.api.checks import path, words
from dvtcli.operations.api.open_bus import connect, simulated_words
from dvtcli.operations.api.python_bus import Bus
from dvtcli.operations.api.told import LOG, Message
from dvtcli.operations.opening.serve import LOOPBACK, ServeRequest, serving
from dvtcli.operations.user.options import options_of

if TYPE_CHECKING:
    from dvtcli.device.change.progress import Progress


class JoinOptions(TypedDict, total=False):
    """Options of `ServedBus.connect` for `dvtcli.connect`."""

    timeout_s: float
    journal: str | Path | None
    ask: Callable[[str], bool] | None
    on_message: Callable[[Message], None] | None
    on_progress: Callable[[Progress], None] | None


@dataclass(frozen=True, slots=True)
class ServedBus:
    """A bus with simulated *nodes* (their node-IDs) that any socketcand client on this machine can join."""

    host: str
    port: int
    nodes: tuple[int, ...]

    @property
    def settings(self) -> dict[str, Any]:
        """Return python-can's arguments to join: `can.Bus(**bus.settings)`."""
        return {"interface": "socketcand", "channel": "can0", "host": self.host, "port": self.port}

    @property
    def words(self) -> tuple[str, ...]:
        """The options for the program `dvtcli` to join: `["dvtcli", *bus.words, "-n", "5", "pdo"]`."""
        return (
            "-i", "socketcand", "-c", "can0", "--bus-kwargs", f"host={self.host}", "--bus-kwargs", f"port={self.port}",
        )  # fmt: skip

    def connect(self, **options: Unpack[JoinOptions]) -> Bus:
        """Join it by `dvtcli.connect` with *options*."""
        return connect(**self.settings, **options)


#: options by the argument's name
_OPTIONS = {"faults": "fault", "signals": "signal", "modules": "modules"}


@contextmanager
def serve(
    *nodes: str,
    faults: Sequence[str] = (),
    signals: Sequence[str] = (),
    modules: Sequence[str] = (),
    state: str | Path | None = None,
) -> Iterator[ServedBus]:
    """Serve simulated *nodes* (`gen4`, `tmcm@5`, `my.eds@9`) on a free loopback port during a block.

    *faults*, *signals* and *modules* are words as of `--fault`, `--signal` and `--modules`; *state* is the folder of
    stored values. Raises UsageError for invalid words, BusUnavailable if no port is free.
    """
    given = {
        "fault": words("faults", faults),
        "signal": words("signals", signals),
        "modules": words("modules", modules),
    }
    options = options_of(given)
    wanted = ServeRequest(simulated_words(nodes), (LOOPBACK, 0), state=None if state is None else path("state", state))
    with serving(options, wanted, LOG.warning) as served:
        thread = threading.Thread(target=served.server.run, name="dvtcli serve", daemon=True)
        thread.start()
        try:
            yield ServedBus(LOOPBACK, served.port or 0, tuple(node.node_id for node in served.nodes))
        finally:
            served.server.stop()
            thread.join()
