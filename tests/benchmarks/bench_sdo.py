"""SDO round trips per second: our client against canopen's own, same virtual bus, same server thread.

    python -m tests.benchmarks sdo

Rounds of both are interleaved; a client is on the bus only during its round. Rates depend on the machine and on
what else it does: the ratio (median of the rounds' ratios) is what to look at; goal: at least 1.0.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from time import perf_counter, process_time

import can
import canopen

from dvtcli.bus.opening import open_bus
from dvtcli.bus.python_can import CanBus
from tests.benchmarks.bench_serve import Sim, sim
from tests.benchmarks.figures import Figure

CHANNEL, NODE = "bench-sdo", 1
Upload = Callable[[int, int], bytes]
Download = Callable[[int, int, bytes], None]


class Server(threading.Thread):
    """Answers every upload with 4 bytes and acknowledges every expedited download."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.bus = can.Bus(CHANNEL, interface="virtual", ignore_config=True)
        self.stopping = False

    def run(self) -> None:
        while not self.stopping:
            request = self.bus.recv(0.05)
            if request is None or request.arbitration_id != 0x600 + NODE:
                continue
            data = bytes(request.data)
            if data[0] == 0x40:
                answer = b"\x43" + data[1:4] + b"\x01\x02\x03\x04"
            elif data[0] >> 5 == 1:
                answer = b"\x60" + data[1:4] + bytes(4)
            else:
                continue
            self.bus.send(can.Message(arbitration_id=0x580 + NODE, data=answer, is_extended_id=False))


@contextmanager
def ours() -> Iterator[tuple[Upload, Download]]:
    bus = CanBus(can.Bus(CHANNEL, interface="virtual", ignore_config=True), "virtual", timeout_s=5)
    sdo = bus.sdo(NODE)
    yield sdo.upload, sdo.download
    bus.close()


@contextmanager
def stock() -> Iterator[tuple[Upload, Download]]:
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    network.connect(interface="virtual", channel=CHANNEL, ignore_config=True)
    node = network.add_node(NODE, canopen.ObjectDictionary())
    node.sdo.RESPONSE_TIMEOUT = 5
    yield node.sdo.upload, node.sdo.download
    network.disconnect()


def rates(client: Callable[[], object], requests: int) -> tuple[float, float]:
    """Uploads and downloads per second."""
    with client() as (upload, download):  # type: ignore[attr-defined]
        for _ in range(50):
            upload(0x1800, 1)
        started = perf_counter()
        for _ in range(requests):
            upload(0x1800, 1)
        between = perf_counter()
        for _ in range(requests):
            download(0x1800, 1, b"\x01\x02\x03\x04")
        return requests / (between - started), requests / (perf_counter() - between)


def socketcand_us(server: Sim, requests: int) -> tuple[float, float]:
    """Processor time (µs) of this process for an upload over socketcand: by our client, and by canopen's."""
    where = {"host": "127.0.0.1", "port": server.port}
    with closing(open_bus("socketcand", "can0", None, where, timeout_s=5)) as bus:  # as a command opens it
        own = upload_us(bus.sdo(NODE).upload, requests)
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    network.connect(interface="socketcand", host="127.0.0.1", port=server.port, channel="can0", ignore_config=True)
    node = network.add_node(NODE, canopen.ObjectDictionary())
    node.sdo.RESPONSE_TIMEOUT = 5
    other = upload_us(node.sdo.upload, requests)
    network.disconnect()
    return own, other


def upload_us(upload: Upload, requests: int) -> float:
    """Processor time (µs) of this process for each *upload*."""
    for _ in range(20):
        upload(0x1000, 0)
    began_s = process_time()
    for _ in range(requests):
        upload(0x1000, 0)
    return 1e6 * (process_time() - began_s) / requests


def figures(rounds: int, requests: int = 1000) -> Iterator[Figure]:
    """Uploads and downloads a second of both clients, and the processor's time for an upload over socketcand."""
    server = Server()
    server.start()
    results = [(rates(ours, requests), rates(stock, requests)) for _ in range(rounds)]
    server.stopping = True
    server.join()
    server.bus.shutdown()
    for number, name in enumerate(("uploads", "downloads")):
        own, other = ([pair[side][number] for pair in results] for side in (0, 1))
        yield Figure(f"SDO {name} a second", "", own, "canopen's client", other, least=1)
    with sim(f"generic@{NODE}") as served:
        pairs = [socketcand_us(served, requests) for _ in range(rounds)]
    own, other = (list(side) for side in zip(*pairs, strict=True))
    yield Figure("SDO upload over socketcand, processor", "µs", own, "canopen's client", other, most=0.66)
