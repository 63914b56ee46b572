"""SDO round trips on vcan0 against canopen, recordings under a flood and at the limit of 1 Mbit/s against candump, and
what a flood of PDOs and a link that was down cost, on a kernel's CAN.

    tests/socketcan/run -t 1500 -x .venv/bin/python -u -m tests.benchmarks.bench_socketcan [NAME...]

One node serves both clients, in rounds that take turns, one client at a time on the bus; only the ratio counts.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import can
import canopen

from dvtcli.bus.opening import open_bus, wait_for_bus
from tests.cli.commands.bus import device
from tests.process import environment
from tests.served_nodes import ServedNodes
from tests.socketcan.conftest import tool
from tests.socketcan.recorded import BEGUN, MONITORED, OVER, candump, frames_in, log, mark

ROUNDS, UPLOADS, FLOOD = 7, 200, 5000
#: how many frames a second of so many data bytes 1 Mbit/s carries at most (11 bits of CAN-ID, stuffed at the worst)
LIMITS, LIMIT_S = {8: 8000, 0: 18000}, 5
#: frames as fast as the link takes them
CANGEN = ("cangen", "vcan0", "-g", "0", "-p", "10", "-D", "i")
LINK: dict[str, Any] = {"interface": "socketcan", "channel": "vcan0", "ignore_config": True}


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
    words = [*CANGEN, "-I", "i", "-L", "8", "-n", str(FLOOD)]
    with tempfile.TemporaryDirectory() as folder:
        beside, path = Path(folder, "candump.log"), Path(folder, "run.log")
        with candump("vcan0", beside):
            logged = log("vcan0", path, beside, meanwhile=lambda: tool(*words))
        print(f"flood: candump {frames_in(beside)}, log {frames_in(path)} and {logged['dropped']} dropped")


@contextmanager
def shaped(frames_a_second: int) -> Iterator[None]:
    """vcan0 lets so many frames through in a second (of 16 bytes each, as the kernel counts them)."""
    bits = f"{frames_a_second * 16 * 8}bit"
    words = ["root", "tbf", "rate", bits, "burst", "256", "limit", "4096"]
    subprocess.run(["tc", "qdisc", "add", "dev", "vcan0", *words], check=True)
    try:
        yield
    finally:
        subprocess.run(["tc", "qdisc", "del", "dev", "vcan0", "root"], check=True)


def limit_of_1_mbit() -> None:
    """Print what candump, `log` and `monitor` have of 5 s at the most frames a second that 1 Mbit/s carries."""
    for length, rate in LIMITS.items():
        for job in (logging, monitoring):
            with tempfile.TemporaryDirectory() as folder, shaped(rate):
                beside = Path(folder, "candump.log")
                count = str(rate * LIMIT_S)
                words = [
                    "cangen",
                    "vcan0",
                    "-g",
                    "0",
                    "-p",
                    "10",
                    "-I",
                    "181",
                    "-L",
                    str(length),
                    "-D",
                    "i",
                    "-n",
                    count,
                ]
                with candump("vcan0", beside):
                    had, dropped, took_s = job(Path(folder), beside, partial(tool, *words))
                there, lasted_s = frames_in(beside), seconds_of(beside)
            print(
                f"{length} bytes, {there / lasted_s:.0f} frames/s: candump {there}; {job.__name__} {had} and {dropped} "
                f"dropped, {had / took_s:.0f} a second until it had all"
            )


def seconds_of(path: Path) -> float:
    """From the first to the last frame of 11 bits of a candump file (s)."""
    times = [float(line[1:18]) for line in path.read_text("utf-8").splitlines() if " 181#" in line]
    return times[-1] - times[0]


def logging(folder: Path, beside: Path, generate: Callable[[], object]) -> tuple[int, int, float]:
    """How many frames `log` has, says that it dropped, and how long it took for them (s)."""
    path, began_s = folder / "run.log", 0.0

    def begin() -> None:
        nonlocal began_s
        began_s = time.perf_counter()
        generate()

    said = log("vcan0", path, beside, meanwhile=begin)
    return frames_in(path), said["dropped"], time.perf_counter() - began_s


def monitoring(folder: Path, beside: Path, generate: Callable[[], object]) -> tuple[int, int, float]:
    """The same of `monitor` in a pipe."""
    out, errors = folder / "out", folder / "errors"
    words = [sys.executable, "-m", "dvtcli", "-i", "socketcan", "-c", "vcan0", "monitor", "--json"]
    with out.open("w") as stdout, errors.open("w") as stderr:
        watching = subprocess.Popen(words, stdout=stdout, stderr=stderr, stdin=subprocess.DEVNULL, env=environment())
        mark("vcan0", BEGUN, beside)
        mark("vcan0", BEGUN, out, form=MONITORED)
        began_s = time.perf_counter()
        generate()
        mark("vcan0", OVER, out, form=MONITORED)
        took_s = time.perf_counter() - began_s
        mark("vcan0", OVER, beside)
        watching.send_signal(signal.SIGINT)
        watching.wait()
    said = re.findall(r"(\d+) frames were dropped|dropped (\d+)", errors.read_text("utf-8"))
    dropped = sum(int(one or other) for one, other in said)
    return out.read_text("utf-8").count('"cob_id":385,'), dropped, took_s


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


PARTS = {part.__name__: part for part in (round_trips, flood, limit_of_1_mbit, woken, back)}

if __name__ == "__main__":
    for name in sys.argv[1:] or PARTS:
        PARTS[name]()
