"""Another master on the bus: a network is not changed beside one, unless that is forced. Real processes."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from tests.simulator.serve.served import Served, served

FILE = "n: {node_id: 1, tpdo: {1: {event_timer: 40}}}\n"
#: what a master sends: an NMT command to a node that is not there, an LSS command, an upload of 0x1000
COMMANDS = {"an NMT command": (0x000, "01 7F"), "an LSS command": (0x7E5, "04 00 00 00 00 00 00 00"),
            "an SDO request to node 3": (0x603, "40 00 10 00 00 00 00 00")}  # fmt: skip


@contextmanager
def sending(bus: can.BusABC, can_id: int, data: bytes) -> Iterator[None]:
    """While the block runs somebody sends that frame all the time."""
    stop = threading.Event()

    def send() -> None:
        while not stop.wait(0.2):
            bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, "generic@1", "generic@3") as made:
        (tmp_path / "net.yaml").write_text(FILE)
        yield made


@pytest.mark.drawn(1)
@pytest.mark.parametrize("said", COMMANDS)
def test_beside_another_master_nothing_is_written(nodes: Served, said: str) -> None:
    can_id, data = COMMANDS[said]
    file = str(nodes.folder / "net.yaml")
    with sending(nodes.attach(), can_id, bytes.fromhex(data)):
        refused = nodes.dvtcli("--yes", "apply", file)
        assert refused.returncode == 6, refused.stderr
        assert f"another master is active: {said} was received" in refused.stderr
        assert nodes.dvtcli("diff", file).returncode == 3
    assert nodes.dvtcli("--yes", "apply", file).returncode == 0


def test_who_insists_goes_on_beside_it(nodes: Served) -> None:
    can_id, data = COMMANDS["an LSS command"]
    with sending(nodes.attach(), can_id, bytes.fromhex(data)):
        assert nodes.dvtcli("--yes", "--force", "apply", str(nodes.folder / "net.yaml")).returncode == 0
