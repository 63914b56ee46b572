from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count

import can
import pytest

from dvtcli.bus.python_can import CanBus
from tests.bus.scripted import Script, Server, well_behaved

_NUMBERS = count(1)


@pytest.fixture
def channel() -> str:
    """A virtual channel that no other test uses."""
    return f"test-{next(_NUMBERS)}"


@pytest.fixture
def serve(channel: str) -> Iterator[Callable[..., tuple[CanBus, Server]]]:
    """Start a scripted server and a bus that talks to it."""
    started: list[tuple[CanBus, Server]] = []

    def start(script: Script = well_behaved, *, timeout_s: float = 0.25, retries: int = 0) -> tuple[CanBus, Server]:
        ours = can.Bus(channel, interface="virtual", ignore_config=True)
        pair = CanBus(ours, f"virtual:{channel}", timeout_s=timeout_s, retries=retries), Server(channel, script)
        started.append(pair)
        return pair

    yield start
    for bus, server in started:
        bus.close()
        server.stop()
