"""What `monitor` and `log` keep up with: frames a second, drops, and the processor's share.

    python tests/benchmarks/bench_monitor.py [SECONDS [FRAMES_A_SECOND]]

A sender puts TPDOs of a simulated node on the bus of a `dvtcli sim` on 127.0.0.1, at a steady rate; the program that
watches is a process of its own. Every frame has another velocity, so that each is decoded and is a change. Shares are
of one core.
"""

from __future__ import annotations

import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Callable
from pathlib import Path

import can

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.benchmarks.bench_serve import ROOT, Sim, sim

#: how long after its first sign of life the watcher listens, and how long it has to take the last frames (s)
START_S, END_S = 1.0, 2.0


def cpu_s(pid: int) -> float:
    """Processor time of a process so far, in seconds (Linux)."""
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / 100


def send(bus: can.BusABC, seconds: float, rate: int) -> int:
    """Send TPDO2 with a velocity that counts, *rate* times a second in bursts of 5 ms; how many."""
    began, sent = time.perf_counter(), 0
    while (at := time.perf_counter() - began) < seconds:
        while sent < at * rate:
            data = sent.to_bytes(4, "little") + b"\x78\x00\x88\xff"
            bus.send(can.Message(arbitration_id=0x281, data=data, is_extended_id=False))
            sent += 1
        time.sleep(0.005)
    return sent


def words(server: Sim, *command: str) -> list[str]:
    """The command line of a watcher."""
    bus = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={server.port}"]
    return [sys.executable, "-m", "dvtcli", *bus, "-n", "1", "-y", *command]


def measured(
    process: subprocess.Popen[bytes], is_up: Callable[[], object], bus: can.BusABC, seconds: float, rate: int
) -> tuple[int, float, float]:
    """Frames sent, frames a second, and the share of a core that *process* took meanwhile; begins once it *is_up*."""
    while not is_up():
        time.sleep(0.02)
    time.sleep(START_S)
    cpu, began = cpu_s(process.pid), time.perf_counter()
    sent = send(bus, seconds, rate)
    took = time.perf_counter() - began
    share = (cpu_s(process.pid) - cpu) / took
    time.sleep(END_S)
    return sent, sent / took, share


def in_a_pipe(server: Sim, bus: can.BusABC, seconds: float, rate: int) -> tuple[int, float, float, int]:
    """`monitor` as JSONL."""
    process = subprocess.Popen(words(server, "monitor"), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=ROOT)
    received: list[bytes] = []

    def read() -> None:
        assert process.stdout is not None
        received.extend(process.stdout)

    reader = threading.Thread(target=read)
    reader.start()
    sent, per_second, share = measured(process, lambda: received, bus, seconds, rate)
    process.send_signal(signal.SIGINT)
    reader.join()
    process.wait()
    return sent, per_second, share, sum(json.loads(line)["cob_id"] == 0x281 for line in received)


def on_a_screen(server: Sim, bus: can.BusABC, seconds: float, rate: int) -> tuple[int, float, float, int]:
    """`monitor` on a terminal of 120 x 40; what it counted stands in its header."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
    environment = os.environ | {"TERM": "xterm-256color"}
    process = subprocess.Popen(
        words(server, "monitor"), stdin=slave, stdout=slave, stderr=slave, cwd=ROOT, env=environment,
        start_new_session=True,
    )  # fmt: skip
    os.close(slave)
    written = bytearray()

    def read() -> None:
        try:
            while data := os.read(master, 65536):
                written.extend(data)
        except OSError:
            return  # the terminal went away with the program

    reader = threading.Thread(target=read)
    reader.start()
    sent, per_second, share = measured(process, lambda: b"MONITOR" in written, bus, seconds, rate)
    os.write(master, b"f0x281\rr")  # drawn anew, so that the last counts are among what was written
    time.sleep(1)
    dropped = screen_count(bytes(written), "dropped")
    os.write(master, b"q")
    process.wait()
    reader.join()
    os.close(master)
    return sent, per_second, share, sent - dropped


def screen_count(written: bytes, what: str) -> int:
    """The last number before *what* that was drawn."""
    import pyte

    screen = pyte.Screen(120, 40)
    pyte.ByteStream(screen).feed(written)
    found = re.search(rf"(\d+) {what}", screen.display[0])
    assert found is not None, screen.display[0]
    return int(found[1])


def into_a_file(server: Sim, bus: can.BusABC, seconds: float, rate: int) -> tuple[int, float, float, int]:
    """`log` into a candump file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.log"
        process = subprocess.Popen(
            words(server, "log", str(path)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT
        )
        sent, per_second, share = measured(process, path.exists, bus, seconds, rate)
        process.send_signal(signal.SIGINT)
        process.wait()
        received = sum(message.arbitration_id == 0x281 for message in can.CanutilsLogReader(path))
    return sent, per_second, share, received


WAYS: dict[str, Callable[[Sim, can.BusABC, float, int], tuple[int, float, float, int]]] = {
    "monitor in a pipe": in_a_pipe,
    "monitor on a screen of 120 x 40": on_a_screen,
    "log into a .log file": into_a_file,
}


def main(seconds: float = 5.0, rate: int = 5500) -> None:
    """Measure all and print it."""
    print(f"{'':34}{'frames/s':>10}{'sent':>9}{'missing':>9}{'CPU share':>11}")
    for name, measure in WAYS.items():
        with sim("gen4@1") as server, server.bus() as bus:
            sent, per_second, share, received = measure(server, bus, seconds, rate)
        print(f"{name:34}{per_second:10.0f}{sent:9}{sent - received:9}{share:11.2f}")


if __name__ == "__main__":
    match sys.argv[1:]:
        case [seconds, rate]:
            main(float(seconds), int(rate))
        case [seconds]:
            main(float(seconds))
        case _:
            main()
