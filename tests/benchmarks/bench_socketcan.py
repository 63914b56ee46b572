"""SDO round trips on vcan0 against canopen, a recording under a flood against candump, and what a flood of PDOs and
a link that was down cost, on a kernel's CAN.

    tests/socketcan/run -x .venv/bin/python -u -m tests.benchmarks.bench_socketcan

One node serves both clients, in rounds that take turns, one client at a time on the bus; only the ratio counts.
"""

from __future__ import annotations

import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import can
import canopen

from dvtcli.bus.opening import open_bus
from dvtcli.bus.waiting import wait_for_bus
from tests.commands.bench import Bench
from tests.commands.bus import device
from tests.served_nodes import ServedNodes

ROUNDS, UPLOADS, FLOOD = 7, 200, 5000
LINK = {"interface": "socketcan", "channel": "vcan0", "ignore_config": True}


def rate(upload: Callable[[], object]) -> float:
    """Uploads a second."""
    began_s = time.perf_counter()
    for _ in range(UPLOADS):
        upload()
    return UPLOADS / (time.perf_counter() - began_s)


def with_dvtcli() -> float:
    """Uploads a second by our client, alone with the node."""
    bus = open_bus("socketcan", "vcan0", timeout_s=5)
    found = rate(lambda: bus.sdo(1).upload(0x1018, 1))
    bus.close()
    return found


def with_canopen() -> float:
    """Uploads a second by canopen's client, alone with the node."""
    network = canopen.Network()
    network.connect(**LINK)
    node = network.add_node(1, canopen.ObjectDictionary())
    found = rate(lambda: node.sdo.upload(0x1018, 1))
    network.disconnect()
    return found


def round_trips() -> None:
    """Print both rates and their ratio."""
    theirs = can.Bus(**LINK)
    with ServedNodes(theirs, [device("gen4")]):
        rates = [(with_dvtcli(), with_canopen()) for _ in range(ROUNDS)]
    theirs.shutdown()
    ours, others = (median(column) for column in zip(*rates, strict=True))
    ratio = median(one / two for one, two in rates)
    print(f"SDO uploads/s on vcan0: dvtcli {ours:.0f}, canopen {others:.0f}, ratio {ratio:.2f}")


def flood() -> None:
    """Print what `log` and candump have of frames that come as fast as cangen sends."""
    with tempfile.TemporaryDirectory() as folder:
        beside, path = Path(folder, "candump.log"), Path(folder, "run.log")
        with (
            beside.open("w") as file,
            subprocess.Popen(["candump", "-L", "-r", "8000000", "vcan0"], stdout=file) as dump,
        ):
            generating = f"sleep 1; exec cangen vcan0 -g 0 -p 10 -I i -L 8 -D i -n {FLOOD}"
            with Bench((), {"interface": "socketcan", "channel": "vcan0"}) as bench:
                generator = subprocess.Popen(["sh", "-c", generating], stdin=subprocess.DEVNULL)
                logged = bench.run(f"log {path} --duration 8 --json").document
                generator.wait()
            dump.terminate()
        there = beside.read_text("utf-8").count("\n")
    print(f"flood: candump {there}, log {logged['frames']} and {logged['dropped']} dropped")


def share(*, everything: bool) -> float:
    """The processor's share that waiting for answers takes beside a flood of PDOs; *everything*: they are heard."""
    bus = open_bus("socketcan", "vcan0", timeout_s=5)
    if everything:
        bus.receive(0)
    began_s, spent_s = time.perf_counter(), time.thread_time()
    for _ in range(20):
        bus.sdo(1).upload(0x1018, 1)
        bus.sleep(0.05)
    found = (time.thread_time() - spent_s) / (time.perf_counter() - began_s)
    bus.close()
    return found


def woken() -> None:
    """Print both shares, and their ratio, under 2000 PDOs a second."""
    theirs = can.Bus(**LINK, can_filters=[{"can_id": 0x601, "can_mask": 0x7FF}])
    words = ["cangen", "vcan0", "-g", "0.5", "-I", "181", "-L", "8", "-D", "i"]
    with ServedNodes(theirs, [device("gen4")]), subprocess.Popen(words, stdin=subprocess.DEVNULL) as generator:
        shares = [(share(everything=True), share(everything=False)) for _ in range(ROUNDS)]
        generator.terminate()
    theirs.shutdown()
    every, own = (median(column) for column in zip(*shares, strict=True))
    print(
        f"waiting beside a flood of PDOs: {every:.1%} hearing all, {own:.1%} hearing services, ratio {own / every:.2f}"
    )


def back() -> None:
    """Print how long after its link is up again a bus is open, where it was down for some seconds."""
    found = []
    for _ in range(3):
        subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
        up_s: list[float] = []

        def up(up_s: list[float] = up_s) -> None:
            subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
            up_s.append(time.perf_counter())

        threading.Timer(4.0, up).start()
        bus = wait_for_bus(lambda: open_bus("socketcan", "vcan0"), lambda: False)
        opened_s = time.perf_counter()
        assert bus is not None
        bus.close()
        while not up_s:
            time.sleep(0.01)
        found.append(opened_s - up_s[0])
    print(f"a link that was down for 4 s: its bus is open {1000 * median(found):.0f} ms after it is up")


if __name__ == "__main__":
    round_trips()
    flood()
    woken()
    back()
