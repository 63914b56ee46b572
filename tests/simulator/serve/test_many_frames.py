"""Nothing is lost: `pytest tests/simulator/serve --serve-frames 100000` sends as many frames to 4 clients."""

from __future__ import annotations

import threading
from pathlib import Path

import can
import pytest

from tests.simulator.serve.served import raw_client, served

CLIENTS = 4


def read(port: int, ready: threading.Barrier, count: int, received: list[int]) -> None:
    """Note the numbers in the next *count* frames with CAN-ID 0x123."""
    with raw_client(port) as client:
        ready.wait()
        rest = b""
        while len(received) < count and (data := client.recv(1 << 16)):
            *whole, rest = (rest + data).split(b">")
            received.extend(int(words[4], 16) for line in whole if (words := line.split())[2] == b"123")


@pytest.mark.counted
def test_no_frame_is_lost_on_its_way_to_four_clients(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    count: int = request.config.getoption("--serve-frames")
    with served(tmp_path, "generic@1") as server:
        received: list[list[int]] = [[] for _ in range(CLIENTS)]
        ready = threading.Barrier(CLIENTS + 1)
        readers = [threading.Thread(target=read, args=(server.port, ready, count, one)) for one in received]
        for reader in readers:
            reader.start()
        ready.wait()
        bus = server.attach()
        for number in range(count):
            bus.send(can.Message(arbitration_id=0x123, data=number.to_bytes(4, "big"), is_extended_id=False))
        for reader in readers:
            reader.join()
        assert all(one == list(range(count)) for one in received)
        server.end()
        assert server.complaints.strip() == "interrupted"
