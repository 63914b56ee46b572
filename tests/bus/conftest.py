from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count

import pytest

from dvtcli.bus.python_can import CanBus
from tests.bus.scripted import Lockstep, Script, Server, well_behaved

_NUMBERS = count(1)


@pytest.fixture
def channel() -> str:
    """A virtual channel that no other test uses."""
    return f"test-{next(_NUMBERS)}"


@pytest.fixture
def serve(channel: str) -> Iterator[Callable[..., tuple[CanBus, Server]]]:
    """Start a scripted server and a bus that talks to it; where it is not *prompt*, also as slowly as it likes."""
    started: list[tuple[CanBus, Server]] = []

    def start(
        script: Script = well_behaved, *, timeout_s: float = 0.1, retries: int = 0, prompt: bool = True
    ) -> tuple[CanBus, Server]:
        ours, server = Lockstep(channel), Server(channel, script)
        if prompt:
            ours.server = server
        started.append((CanBus(ours, f"virtual:{channel}", timeout_s=timeout_s, retries=retries), server))
        return started[-1]

    yield start
    for bus, server in started:
        bus.close()
        server.stop()
