"""pytest fixtures for tests against CANopen devices: simulated nodes, in the test or on a bus for other programs.

    pytest_plugins = ["dvtcli.testing"]         # in the outermost conftest.py

Nothing is loaded without that line. Each test gets its own nodes and its own state folder: the user's journals, locks
and backups are neither read nor written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import pytest

from dvtcli.errors import Bug, DvtcliError
from dvtcli.operations.api.python_bus import ServedBus, serve, simulate

if TYPE_CHECKING:
    from dvtcli.device.change.applied import Progress
    from dvtcli.operations.api.calls import Message
    from dvtcli.operations.api.python_bus import Bus
    from dvtcli.operations.api.python_node import Node

#: The folder of this package.
_PACKAGE = f"{Path(__file__).parent}{os.sep}"
__all__ = [
    "Serve",
    "ServedBus",
    "Simulate",
    "dvtcli_bus",
    "dvtcli_node",
    "dvtcli_nodes",
    "dvtcli_serve",
    "dvtcli_simulate",
    "dvtcli_state",
    "serve",
]


class Simulate(Protocol):
    """The type of the fixture `dvtcli_simulate`: a call of `dvtcli.simulate`."""

    def __call__(
        self,
        *nodes: str,
        faults: tuple[str, ...] | list[str] = (),
        signals: tuple[str, ...] | list[str] = (),
        modules: tuple[str, ...] | list[str] = (),
        timeout_s: float = 0.5,
        ask: Callable[[str], bool] | None = None,
        on_message: Callable[[Message], None] | None = None,
        on_progress: Callable[[Progress], None] | None = None,
    ) -> Bus:
        """A bus with simulated *nodes*."""


class Serve(Protocol):
    """The type of the fixture `dvtcli_serve`: a call of `serve`, whose bus lasts until the test's end."""

    def __call__(
        self,
        *nodes: str,
        faults: Sequence[str] = (),
        signals: Sequence[str] = (),
        modules: Sequence[str] = (),
        state: str | Path | None = None,
    ) -> ServedBus:
        """A bus on loopback with simulated *nodes*."""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_makereport(call: pytest.CallInfo[None]) -> None:
    """End the traceback of an expected error at the test's own line; `--full-trace` shows all of it."""
    for entry in call.excinfo.traceback if call.excinfo is not None else ():
        if str(entry.path).startswith(_PACKAGE):
            entry.frame.f_globals.setdefault("__tracebackhide__", _is_expected)


def _is_expected(raised: pytest.ExceptionInfo[BaseException]) -> bool:
    """Tell whether the error's text is enough; a fault of dvtcli keeps its traceback."""
    return isinstance(raised.value, DvtcliError) and not isinstance(raised.value, Bug)


@pytest.fixture
def dvtcli_state(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The test's own folder of journals, locks and backups, also for programs started by the test."""
    folder = tmp_path_factory.mktemp("dvtcli-state")
    for name in ("XDG_STATE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(folder))
    return folder


@pytest.fixture
def dvtcli_nodes() -> tuple[str, ...]:
    """The nodes simulated by `dvtcli_bus` and `dvtcli_node`; override it: `return ("my.eds@5",)`."""
    return ("generic",)


@pytest.fixture
def dvtcli_bus(dvtcli_nodes: tuple[str, ...] | str, dvtcli_simulate: Simulate) -> Bus:
    """A bus with the nodes of `dvtcli_nodes`, in this process; a text is one node."""
    return dvtcli_simulate(*((dvtcli_nodes,) if isinstance(dvtcli_nodes, str) else dvtcli_nodes))


@pytest.fixture
def dvtcli_node(dvtcli_bus: Bus) -> Node:
    """The first node of `dvtcli_bus`."""
    return dvtcli_bus.node()


@pytest.fixture
def dvtcli_simulate(dvtcli_state: Path) -> Iterator[Simulate]:  # noqa: ARG001 - it is the test's state folder
    """Call it as `dvtcli.simulate`: a bus in this process, closed at the test's end."""
    with ExitStack() as buses:
        yield lambda *nodes, **options: buses.enter_context(simulate(*nodes, **options))


@pytest.fixture
def dvtcli_serve(dvtcli_state: Path) -> Iterator[Serve]:  # noqa: ARG001 - as above
    """Call it as `serve`: a bus on loopback for the firmware's own programs, closed at the test's end."""
    with ExitStack() as buses:
        yield lambda *nodes, **options: buses.enter_context(serve(*nodes, **options))
