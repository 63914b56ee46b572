"""The ways to a `Bus`: a CAN interface by python-can's names, or simulated nodes in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.bus.turns import in_callers_thread
from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import call_back, path, seconds, whole, word, words, wrong
from dvtcli.operations.api.python_bus import Bus
from dvtcli.operations.api.told import Message, Told
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import BIT_RATES, options_of

if TYPE_CHECKING:
    from dvtcli.device.change.progress import Progress


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
