"""`plan` and `apply` of a network file from the start of the command to its end: `bench_network_command.py [NODES...]`.

The nodes are those of `bench_network.py`, served by another process on 127.0.0.1 with a bit rate and servers that take
their time; they are compared with the least that the same frames take: all their bits on the wire, or the longest chain
of one node's requests and answers. What `apply` listens before its first write (2 s) is not counted; the start of
Python is, and has a line of its own: a command that asks one node for one object. `--json FILE` keeps the run,
which `python -m tests.benchmarks --compare` compares with another one.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from dvtcli.operations.plans.apply_network import apply_network
from dvtcli.operations.plans.plan_network import plan_network
from dvtcli.operations.session.consent import LISTEN_S
from examples.many_nodes import network
from tests.benchmarks.bench_network import BIT_RATES, described, wired
from tests.benchmarks.bench_serve import Sim, sim
from tests.benchmarks.figures import ENVIRONMENT, ROOT, Figure, as_json, table

SERVERS_MS, MOST = (0, 2, 10), 1.25


def file_of(count: int, folder: str) -> Path:
    """The network file of *count* nodes, whose event timers leave room on every bus."""
    file = Path(folder) / "many.yaml"
    text = network(count).replace("{store: true}", "{dcf: generic}")
    file.write_text(text.replace("event_timer: 10", "event_timer: 300"))
    return file


def limits_s(count: int, bit_rate: int, server_ms: int) -> tuple[float, float]:
    """The least seconds that the frames of `plan` take, and those of `apply`, which plans, too."""
    bus = wired(count, bit_rate, server_ms / 1000)
    with tempfile.TemporaryDirectory() as folder, described(bus, count, folder) as session:
        file = file_of(count, folder)
        bus.begin()
        plan = plan_network(session, str(file))
        plan_s = bus.limit_s()
        apply_network(session, plan)
        return plan_s, bus.limit_s()


def took_s(one: Sim, folder: str, bit_rate: int, *words: str) -> float:
    """Seconds from the start of dvtcli with *words* on the bus of *one* to its end."""
    bus = ("-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={one.port}")
    command = [sys.executable, "-m", "dvtcli", *bus, "-b", str(bit_rate), "--yes", *words]
    environment = {**ENVIRONMENT, "HOME": folder, "XDG_STATE_HOME": folder, "XDG_DATA_HOME": folder}
    began_s = time.monotonic()
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True, cwd=ROOT, env=environment)
    return time.monotonic() - began_s


def figures(count: int, rounds: int) -> Iterator[Figure]:
    """The figures of *count* nodes at every bit rate with every time that a server takes."""
    for bit_rate in BIT_RATES:
        for server_ms in SERVERS_MS:
            plan_s, apply_s = limits_s(count, bit_rate, server_ms)
            starts, plans, applies = list[float](), list[float](), list[float]()
            for _ in range(rounds):
                served = (*(f"generic@{node_id}" for node_id in range(1, count + 1)), "-b", str(bit_rate))
                with tempfile.TemporaryDirectory() as folder, sim(*served, "--latency", str(server_ms)) as one:
                    file = str(file_of(count, folder))
                    starts.append(took_s(one, folder, bit_rate, "--node", "1", "read", "1000"))
                    plans.append(took_s(one, folder, bit_rate, "plan", file))
                    applies.append(took_s(one, folder, bit_rate, "apply", file) - LISTEN_S)
            at = f"{count} nodes, {bit_rate // 1000} kbit/s, {server_ms} ms"
            yield Figure(f"plan, {at}", "s", plans, "the frames alone", [plan_s] * rounds, most=MOST)
            yield Figure(f"apply, {at}", "s", applies, "the frames alone", [apply_s] * rounds, most=MOST)
            yield Figure(f"read of one object, {at}", "s", starts, "the frames of plan alone", [plan_s] * rounds)


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(prog="bench_network_command.py")
    parser.add_argument("nodes", nargs="*", type=int, metavar="NODES", help="16, 64 and 127 unless given")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()
    found: list[Figure] = []

    def measured() -> Iterator[Figure]:
        for count in options.nodes or (16, 64, 127):
            for figure in figures(count, options.rounds):
                found.append(figure)
                yield figure

    for line in table(measured()):
        print(line, flush=True)
    if options.json:
        options.json.write_text(as_json(found), "utf-8")


if __name__ == "__main__":
    main()
