"""What `dvtcli sim` carries: SDO round trips, frames to many clients, and 127 nodes at work.

    python tests/benchmarks/bench_serve.py [SECONDS [FRAMES]]

The nodes are in another process, on 127.0.0.1. Rates depend on the machine and on what else it does; CPU shares are
those of the `sim` process alone. Jitter is by the server's own time stamps: when a heartbeat of 127 nodes came,
against when it was due.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from statistics import median, pstdev

import can
import canopen

from dvtcli.bus.opening import open_bus

ROOT = Path(__file__).resolve().parents[2]


#: counts the frames 0x123 that come in order, until all have come
READER = """
import socket, sys
client = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
for request in (b"", b"< open can0 >", b"< rawmode >"):
    client.sendall(request)
    client.recv(256)
print("ready", flush=True)
count, rest = 0, b""
while count < int(sys.argv[2]) and (data := client.recv(1 << 20)):
    *whole, rest = (rest + data).split(b">")
    for line in whole:
        if b" 123 " in line:
            count += int(line.split()[-1], 16) == count
print(count)
"""


class Sim:
    """A running `dvtcli sim` at *port*."""

    def __init__(self, process: subprocess.Popen[str], port: int) -> None:
        self.process, self.port = process, port

    def bus(self) -> can.BusABC:
        """python-can's own client."""
        return can.Bus(interface="socketcand", host="127.0.0.1", port=self.port, channel="can0", ignore_config=True)

    def cpu_s(self) -> float:
        """Processor time that the process took so far, in seconds (Linux; 0 elsewhere)."""
        stat = Path(f"/proc/{self.process.pid}/stat")
        if not stat.exists():
            return 0.0
        user, system = stat.read_text().rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / 100


@contextmanager
def sim(*words: str) -> Iterator[Sim]:
    """`dvtcli sim` with *words*, as a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        ready = Path(folder) / "ready"
        process = subprocess.Popen(
            [sys.executable, "-m", "dvtcli", "sim", *words, "--listen", "127.0.0.1:0", "--ready-file", str(ready)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=ROOT,
        )
        while not ready.exists():
            assert process.poll() is None
            time.sleep(0.02)
        try:
            yield Sim(process, int(ready.read_text().rpartition(":")[2]))
        finally:
            process.terminate()
            process.wait()


def per_second(upload: Callable[[int, int], bytes], seconds: float) -> float:
    """Uploads a second."""
    for _ in range(20):
        upload(0x1018, 1)
    began, count = time.perf_counter(), 0
    while time.perf_counter() - began < seconds:
        upload(0x1018, 1)
        count += 1
    return count / (time.perf_counter() - began)


def round_trips(server: Sim, seconds: float) -> Iterator[tuple[str, float]]:
    """Uploads a second by dvtcli's client and by canopen's."""
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": server.port}, timeout_s=5)
    yield "dvtcli's client", per_second(bus.sdo(1).upload, seconds)
    bus.close()
    link = server.bus()
    network = canopen.Network(bus=link)
    network.notifier = can.Notifier(link, network.listeners, 1)
    node = network.add_node(1, canopen.ObjectDictionary())
    node.sdo.RESPONSE_TIMEOUT = 5
    yield "canopen's client", per_second(node.sdo.upload, seconds)
    network.notifier.stop()
    link.shutdown()


def to_many(server: Sim, clients: int, count: int) -> tuple[float, int]:
    """Frames a second from one client to *clients* others, each its own process, and how many of them were lost."""
    words = [sys.executable, "-c", READER, str(server.port), str(count)]
    readers = [subprocess.Popen(words, stdout=subprocess.PIPE, text=True) for _ in range(clients)]
    for reader in readers:
        assert reader.stdout is not None
        assert reader.stdout.readline() == "ready\n"
    with server.bus() as sender:
        began = time.perf_counter()
        for number in range(count):
            sender.send(can.Message(arbitration_id=0x123, data=number.to_bytes(4, "big"), is_extended_id=False))
        counted = [int(reader.communicate()[0]) for reader in readers]
    return count / (time.perf_counter() - began), clients * count - sum(counted)


def configure(server: Sim, nodes: int) -> None:
    """Let nodes 1..*nodes* send 4 TPDOs on every SYNC and a heartbeat every 100 ms; start them."""
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": server.port}, timeout_s=5)
    for node in range(1, nodes + 1):
        sdo = bus.sdo(node)
        sdo.download(0x1017, 0, (100).to_bytes(2, "little"))
        for number in range(4):
            cob_id = 0x180 + 0x100 * number + node
            sdo.download(0x1800 + number, 1, (cob_id | 1 << 31).to_bytes(4, "little"))
            sdo.download(0x1800 + number, 2, b"\x01")
            if not sdo.upload(0x1A00 + number, 0)[0]:
                sdo.download(0x1A00 + number, 1, bytes.fromhex("10004160"))
                sdo.download(0x1A00 + number, 0, b"\x01")
            sdo.download(0x1800 + number, 1, cob_id.to_bytes(4, "little"))
    bus.close()


def at_work(server: Sim, nodes: int, seconds: float, period_s: float) -> dict[str, float]:
    """CPU share of *nodes* nodes with heartbeats and SYNCs every *period_s*; jitter of heartbeats."""
    with server.bus() as bus:
        bus.send(can.Message(arbitration_id=0, data=[1, 0], is_extended_id=False))
        beats: dict[int, list[float]] = {}
        tpdos = syncs = 0
        cpu, began = server.cpu_s(), time.perf_counter()
        due = began
        while (now := time.perf_counter()) < began + seconds:
            if now >= due:
                bus.send(can.Message(arbitration_id=0x080, is_extended_id=False))
                due, syncs = due + period_s, syncs + 1
            frame = bus.recv(max(0.0, due - time.perf_counter()))
            if frame is None:
                continue
            if frame.arbitration_id >= 0x700:
                beats.setdefault(frame.arbitration_id, []).append(frame.timestamp)
            elif frame.arbitration_id > 0x180:
                tpdos += 1
        share = (server.cpu_s() - cpu) / (time.perf_counter() - began)
    gaps = [later - earlier for times in beats.values() for earlier, later in pairwise(times[2:])]
    off_ms = sorted(abs(gap - 0.1) * 1000 for gap in gaps)
    return {
        "CPU share of sim": share,
        "SYNCs sent": syncs,
        "TPDOs expected": 4 * nodes * syncs,
        "TPDOs heard": tpdos,
        "heartbeats heard": sum(map(len, beats.values())),
        "heartbeat jitter, median (ms)": median(off_ms),
        "heartbeat jitter, 99 % (ms)": off_ms[int(len(off_ms) * 0.99)],
        "heartbeat period, deviation (ms)": pstdev(gaps) * 1000,
    }


def main(seconds: float = 3.0, count: int = 100_000) -> None:
    """Measure all and print it."""
    with sim("generic@1") as server:
        for name, rate in round_trips(server, seconds):
            print(f"{f'SDO uploads a second, {name}':62}{rate:10.0f}")
        rate, lost = to_many(server, 4, count)
        print(f"{f'{count} frames to 4 clients, a second':62}{rate:10.0f}\n{'  of them lost':62}{lost:10}")
    for bitrate in (125_000, 500_000, 1_000_000):
        with sim("generic@1", "-b", str(bitrate)) as server:
            rate = next(rate for _, rate in round_trips(server, seconds))
            what = f"SDO uploads a second at {bitrate} bit/s, wire limit {bitrate / 239:.0f}"
            print(f"{what:62}{rate:10.0f}")
    for nodes, period_s in ((16, 0.1), (127, 1.0)):
        with sim(*(f"generic@{node}" for node in range(1, nodes + 1))) as server:
            configure(server, nodes)
            print(f"{nodes} nodes, heartbeats every 100 ms, 4 TPDOs on a SYNC every {period_s:g} s:")
            for name, value in at_work(server, nodes, 2 * seconds, period_s).items():
                print(f"  {name:60} {value:9.3f}")


if __name__ == "__main__":
    match sys.argv[1:]:
        case [seconds, count]:
            main(float(seconds), int(count))
        case [seconds]:
            main(float(seconds))
        case _:
            main()
