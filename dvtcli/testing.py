"""pytest fixtures for whoever tests against a CANopen device: simulated nodes, alone or on a bus that programs join.

    pytest_plugins = ["dvtcli.testing"]         # in the outermost conftest.py

Nothing is loaded without that line. Each test gets nodes of its own, and a state folder of its own: no journal, lock
or backup of the user's is read or written. Does not know what is tested.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from dvtcli.operations.api.open_bus import simulate
from dvtcli.operations.api.served_bus import ServedBus, serve

if TYPE_CHECKING:
    from dvtcli.operations.api.python_bus import Bus
    from dvtcli.operations.api.python_node import Node

__all__ = [
    "ServedBus",
    "dvtcli_bus",
    "dvtcli_node",
    "dvtcli_nodes",
    "dvtcli_serve",
    "dvtcli_simulate",
    "dvtcli_state",
    "serve",
]


@pytest.fixture
def dvtcli_state(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The test's own folder of journals, locks and backups, also for programs that the test starts."""
    folder = tmp_path_factory.mktemp("dvtcli-state")
    for name in ("XDG_STATE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(folder))
    return folder


@pytest.fixture
def dvtcli_nodes() -> tuple[str, ...]:
    """Which nodes `dvtcli_bus` and `dvtcli_node` simulate; override it: `return ("my.eds@5",)`."""
    return ("generic",)


@pytest.fixture
def dvtcli_bus(dvtcli_nodes: tuple[str, ...], dvtcli_simulate: Callable[..., Bus]) -> Bus:
    """A bus with the nodes of `dvtcli_nodes`, in this process."""
    return dvtcli_simulate(*dvtcli_nodes)


@pytest.fixture
def dvtcli_node(dvtcli_bus: Bus) -> Node:
    """The first node of `dvtcli_bus`."""
    return dvtcli_bus.node()


@pytest.fixture
def dvtcli_simulate(dvtcli_state: Path) -> Iterator[Callable[..., Bus]]:  # noqa: ARG001 - it is the test's state folder
    """Call it as `dvtcli.simulate`: a bus in this process, which is left at the test's end."""
    with ExitStack() as buses:
        yield lambda *nodes, **options: buses.enter_context(simulate(*nodes, **options))


@pytest.fixture
def dvtcli_serve(dvtcli_state: Path) -> Iterator[Callable[..., ServedBus]]:  # noqa: ARG001 - as above
    """Call it as `serve`: a bus on loopback that the firmware's own programs join, gone at the test's end."""
    with ExitStack() as buses:
        yield lambda *nodes, **options: buses.enter_context(serve(*nodes, **options))
