"""The ways to a `Bus`: a CAN interface by python-can's names, or simulated nodes in this process."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from dvtcli.bus.turns import in_callers_thread
from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.calls import LOG, Message, Told
from dvtcli.operations.api.checks import call_back, path, seconds, whole, word, words, wrong
from dvtcli.operations.api.python_bus import Bus
from dvtcli.operations.session.serve import LOOPBACK, ServeRequest, serving
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import BIT_RATES, options_of

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Progress


def connect(
    interface: str | None = None,
    channel: str | int | None = None,
    bitrate: int | None = None,
    *,
    timeout_s: float = 0.5,
    journal: str | Path | None = None,
    ask: Callable[[str], bool] | None = None,
    on_message: Callable[[Message], None] | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    **more: object,
) -> Bus:
    """Open a CAN interface by python-can's names; None takes python-can's own configuration.

    *bitrate* is in bit/s, *timeout_s* the SDO time-out in seconds, *journal* the folder of journals and backups (the
    user's state folder), *more* further keys of python-can. *ask* gets questions that a command would ask its user, and
    returns whether to go on; without it, and without `yes=True`, such a call raises SafetyRefusal. *on_message* gets
    the messages of a command beside its result, *on_progress* each step of a change on a node. Raises BusUnavailable if
    the bus cannot be opened.
    """
    if interface is not None:
        word("interface", interface, "a name of python-can, such as 'socketcan'")
    if channel is not None and (isinstance(channel, bool) or not isinstance(channel, str | int)):
        raise wrong("channel", channel, "a name of python-can, such as 'can0', or a number")
    if bitrate is not None:
        whole("bitrate", bitrate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    given = {
        "interface": interface,
        "channel": None if channel is None else str(channel),
        "bitrate": bitrate,
        "bus_kwargs": tuple(f"{key}={value}" for key, value in more.items()),
        "timeout": seconds("timeout_s", timeout_s),
        "journal": None if journal is None else str(path("journal", journal)),
    }
    call_back(ask=ask, on_message=on_message, on_progress=on_progress)
    return _opened(given, Told(on_message, ask), on_progress)


def simulate(
    *nodes: str,
    faults: tuple[str, ...] | list[str] = (),
    signals: tuple[str, ...] | list[str] = (),
    modules: tuple[str, ...] | list[str] = (),
    timeout_s: float = 0.5,
    ask: Callable[[str], bool] | None = None,
    on_message: Callable[[Message], None] | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Bus:
    """Open a bus of simulated *nodes* in this process: `gen4`, `tmcm@5`, `my.eds@9`.

    *faults*, *signals* and *modules* are words as of `--fault`, `--signal` and `--modules`. Raises UsageError for an
    invalid word.
    """
    given: dict[str, Any] = {
        "sim": simulated_words(nodes),
        "fault": words("faults", faults),
        "signal": words("signals", signals),
        "modules": words("modules", modules),
    }
    given["timeout"] = seconds("timeout_s", timeout_s)
    call_back(ask=ask, on_message=on_message, on_progress=on_progress)
    return _opened(given, Told(on_message, ask), on_progress)


def simulated_words(nodes: tuple[object, ...]) -> tuple[str, ...]:
    """Return the words for simulated *nodes*; raises UsageError if empty, or for a non-text."""
    if not nodes:
        raise UsageError("which node? a family, such as 'generic', or the path of an EDS")
    for node in nodes:
        if not isinstance(node, str | Path) or "\0" in str(node):
            raise UsageError(f"nodes: {node!r}: a family, such as 'generic' or 'generic@5', or the path of an EDS")
    return tuple(map(str, nodes))


def _opened(given: dict[str, Any], told: Told, on_progress: Callable[[Progress], None] | None) -> Bus:
    with errors_in_calls():
        session = Session(options_of({key: value for key, value in given.items() if value is not None}), told)
        network = session.open_network()
    if on_progress is not None:
        network.on_step = lambda progress: in_callers_thread(lambda: on_progress(progress))
    return Bus(session)


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
