"""SDO round trips on vcan0 against canopen, and a recording under a flood against candump, on a kernel's CAN.

    tests/socketcan/run -x .venv/bin/python -u -m tests.benchmarks.bench_socketcan

One node serves both clients, in rounds that take turns, one client at a time on the bus; only the ratio counts.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import can
import canopen

from dvtcli.bus.opening import open_bus
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


if __name__ == "__main__":
    round_trips()
    flood()
