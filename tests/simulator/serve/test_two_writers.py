"""Several dvtcli at once on one node: every change that was reported is there, and no roll-back takes another's.

Real processes on a served node; what it holds is read by canopen. `--rounds N` does it N times.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import can
import canopen
import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests import process
from tests.harness.forked import Forked
from tests.simulator.serve.served import PATIENCE_S, Served, bus_words, own_environment, served

EVENT_TIMER, INHIBIT_TIME, TYPE = (0x1800, 5), (0x1800, 3), (0x1800, 2)
#: refused by the device at its second entry: what it had changed by then is put back
REFUSED = ("map", "tpdo1", "6041", "5FFF/8", "--force")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, "generic@1", "--latency", "20") as server:
        yield server


@pytest.fixture
def node(server: Served) -> Iterator[canopen.RemoteNode]:
    bus = server.attach()
    network = canopen.Network(bus=bus)
    network.notifier = can.Notifier(bus, network.listeners, 0.1)
    node = network.add_node(canopen.RemoteNode(1, canopen.import_od(str(family_eds("generic")))))
    node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
    yield node
    network.notifier.stop()


def changes(number: int) -> dict[tuple[str, ...], tuple[tuple[int, int], int] | None]:
    """What the four do in round *number*, each with the object and the value that it then has; None where refused."""
    return {
        ("set", "tpdo1", "--timer", str(100 + number)): (EVENT_TIMER, 100 + number),
        ("set", "tpdo1", "--inhibit", str(number)): (INHIBIT_TIME, 10 * number),
        ("set", "tpdo1", "--type", str(1 + number % 240)): (TYPE, 1 + number % 240),
        REFUSED: None,
    }


@pytest.mark.long
@pytest.mark.counted
def test_every_change_that_was_reported_is_there(
    server: Served, node: canopen.RemoteNode, request: pytest.FixtureRequest
) -> None:
    held = {place: number_at(node, place) for place in (EVENT_TIMER, INHIBIT_TIME, TYPE)}
    mapping = entries(node)
    done = 0
    for number in range(1, request.config.getoption("--rounds") + 1):
        wanted = changes(number)
        running = {words: start(server, *words) for words in wanted}
        for words, writer in running.items():
            _, stderr = writer.communicate(timeout=PATIENCE_S)
            change = wanted[words]
            assert writer.returncode in ((0, 6) if change else (1, 6)), stderr
            if writer.returncode == 0 and change is not None:
                held[change[0]] = change[1]
                done += 1
        assert {place: number_at(node, place) for place in held} == held, f"round {number}"
        assert entries(node) == mapping, f"round {number}"
    assert done, "somebody must have come through"


def start(server: Served, *words: str) -> Forked:
    return process.start([*bus_words(server.port), "-n", "1", *words], env=own_environment(server.folder))


def number_at(node: canopen.RemoteNode, place: tuple[int, int]) -> int:
    return int.from_bytes(node.sdo.upload(*place), "little")


def entries(node: canopen.RemoteNode) -> list[int]:
    count = number_at(node, (0x1A00, 0))
    return [number_at(node, (0x1A00, sub)) for sub in range(1, count + 1)] + [number_at(node, (0x1800, 1))]
