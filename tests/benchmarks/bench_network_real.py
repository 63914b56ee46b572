"""`apply` of a network in real time: `bench_network_real.py [--alone] [NODES…]`.

Nodes and dvtcli are in processes of their own. The nodes are those of `bench_network.py`, served by `dvtcli sim` on
127.0.0.1 with a bit rate and servers that take their time, without stores. Beside the seconds that `apply` says
(without its 2 s of listening) stands the limit that the same frames have in virtual time, with the ratio of both, and
that to what `apply` takes in virtual time; and what canopen's `PdoMap.read()` and `save()` of the same PDOs takes, node
by node, on such nodes of its own. Shares are those of one core, over the whole process. A second `plan` has to be
empty, or the row says what went wrong, and the bench ends with 1 after all others.

The rows are those of docs/reference/measurements.md. On a machine that does something else they say little: so each
has the load when it began, and what all other processes took of a core while dvtcli ran (Linux), and the last line
says whether it was quiet. 16 nodes take 3 minutes there, 64 some 8, and 127 some 14, most of it canopen's,
which `--alone` leaves out.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import can
import canopen
from canopen.sdo.client import SdoClient

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from examples.many_nodes import network
from tests.benchmarks.bench_network import run as in_virtual_time
from tests.benchmarks.bench_network import set_with_canopen
from tests.benchmarks.bench_serve import ROOT, Sim, sim

COUNTS, BIT_RATES, SERVERS_MS = (1, 16, 64, 127), (250_000, 500_000, 1_000_000), (2, 10)
#: what all others may take of a core on a machine that is called quiet
QUIET = 0.1
#: how long canopen waits for an answer on a machine that is not (s)
PATIENCE_S = 5
HEAD = (
    "| nodes | kbit/s | a server answers after | `apply` | limit | ratio | of virtual time | canopen | dvtcli's CPU "
    "| the nodes' CPU | CPU a node | dvtcli's peak | the nodes' peak | load | others' CPU |"
)


class Ran(NamedTuple):
    """How a dvtcli ended: its document, seconds, seconds of CPU, and the most memory that it had (MB)."""

    document: dict[str, object]
    took_s: float
    cpu_s: float
    peak_mb: float


class Failed(Exception):
    """What a dvtcli said that did not end with 0."""


def dvtcli(one: Sim, folder: str, bitrate: int, *words: str) -> Ran:
    """Run dvtcli with *words* on the bus of *one*, with its state in *folder*."""
    bus = ("-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={one.port}")
    environment = {**os.environ, "HOME": folder, "XDG_STATE_HOME": folder, "XDG_DATA_HOME": folder}
    command = [sys.executable, "-m", "dvtcli", *bus, "-b", str(bitrate), "--yes", "--json", *words]
    began_s = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment)
    assert process.stdout is not None
    said = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise Failed(f"{words[0]}: {said[:300]}")
    return Ran(json.loads(said), time.monotonic() - began_s, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def peak_mb(pid: int) -> float:
    """The most memory that a process had so far (MB; Linux)."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1024


class Row(NamedTuple):
    """One line of the table, and what all others took of a core meanwhile."""

    text: str
    others: float


def everything_s() -> float:
    """Processor time that everything on this machine took so far, in seconds (Linux; 0 elsewhere)."""
    stat = Path("/proc/stat")
    if not stat.exists():
        return 0.0
    user, nice, system, _idle, _waits, hard, soft, *_ = map(int, stat.read_text().split("\n", 1)[0].split()[1:])
    return (user + nice + system + hard + soft) / 100


def measured(count: int, bitrate: int, server_ms: int, *, alone: bool) -> Row:
    """One line of the table, *alone* without canopen."""
    load = os.getloadavg()[0]
    virtual_s, limit_s, _ = in_virtual_time(count, bitrate, server_ms / 1000)
    served = (*(f"generic@{node_id}" for node_id in range(1, count + 1)), "-b", str(bitrate))
    served += ("--latency", str(server_ms))
    with tempfile.TemporaryDirectory() as folder, sim(*served) as one:
        file = Path(folder) / "many.yaml"
        file.write_text(network(count).replace("{store: true}", "{dcf: generic}"))
        before_s, all_before_s = one.cpu_s(), everything_s()
        ran = dvtcli(one, folder, bitrate, "apply", str(file))
        sim_s, all_s, sim_mb = one.cpu_s() - before_s, everything_s() - all_before_s, peak_mb(one.process.pid)
        dvtcli(one, folder, bitrate, "plan", str(file), "--exit-code")
    with nullcontext() if alone else sim(*served) as other:
        canopen_took = "-" if other is None else f"{canopen_takes(other, count):.2f} s"
    took_s = float(str(ran.document["seconds"]))
    others = max(0.0, all_s - sim_s - ran.cpu_s) / ran.took_s
    return Row(
        f"| {count} | {bitrate // 1000} | {server_ms} ms | {took_s:.2f} s | {limit_s:.2f} s | {took_s / limit_s:.2f} "
        f"| {took_s / virtual_s:.2f} | {canopen_took} | {ran.cpu_s / ran.took_s:.0%} | {sim_s / ran.took_s:.0%} "
        f"| {1000 * ran.cpu_s / count:.0f} ms | {ran.peak_mb:.0f} MB | {sim_mb:.0f} MB | {load:.1f} | {others:.0%} |",
        others,
    )


def canopen_takes(one: Sim, count: int) -> float:
    """Seconds in which canopen sets the PDOs of all nodes of *one*."""
    connection = can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=one.port, ignore_config=True)
    peer = canopen.Network(bus=connection)
    peer.notifier = can.Notifier(connection, peer.listeners, 1)
    SdoClient.RESPONSE_TIMEOUT = PATIENCE_S
    began_s = time.monotonic()
    try:
        set_with_canopen(peer, count)
        return time.monotonic() - began_s
    finally:
        peer.notifier.stop()
        connection.shutdown()


def main(counts: tuple[int, ...], *, alone: bool) -> None:
    os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()
    machine = f"{os.cpu_count()} cores, Python {platform.python_version()}, {platform.system()} {platform.release()}"
    print(f"{datetime.now(UTC):%d %B %Y, %H:%M} UTC; {machine}\n\n{HEAD}")
    print("|---" * HEAD.count(" | ") + "|---|")
    busy, failed = [0.0], False
    for count in counts:
        for bitrate in BIT_RATES:
            for server_ms in SERVERS_MS:
                try:
                    text, others = measured(count, bitrate, server_ms, alone=alone)
                    busy.append(others)
                except Failed as why:
                    failed, text = True, f"| {count} | {bitrate // 1000} | {server_ms} ms | {why} |"
                print(text, flush=True)
    rows = sum(others > QUIET for others in busy)
    quiet = f"not quiet: others took up to {max(busy):.0%} of a core, in {rows} rows more than {QUIET:.0%}."
    print("\nThe machine was " + (quiet if rows else f"quiet: others took {max(busy):.0%} of a core at most."))
    sys.exit(failed)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(tuple(int(one) for one in given if one != "--alone") or COUNTS, alone="--alone" in given)
