"""`apply` of a network in real time, nodes and dvtcli in processes of their own: `bench_network_real.py [NODES…]`.

The nodes of `bench_network.py`, served by `dvtcli sim` on 127.0.0.1 with a bit rate and servers that take their time,
without stores. Beside the seconds that `apply` says (without its 2 s of listening) stands the limit that the same
frames have in virtual time, with the ratio of both, and that to what `apply` takes in virtual time. Shares are those
of one core, over the whole process; on a machine that does something else they, and the ratios, say little. A second
`plan` has to be empty, or the row says what went wrong, and the bench ends with 1 after all others.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from examples.many_nodes import network
from tests.benchmarks.bench_network import run as in_virtual_time
from tests.benchmarks.bench_serve import ROOT, Sim, sim

COUNTS, BIT_RATES, SERVERS_MS = (1, 16, 64, 127), (250_000, 500_000, 1_000_000), (2, 10)


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


def row(count: int, bitrate: int, server_ms: int) -> str:
    """One line of the table."""
    virtual_s, limit_s, _ = in_virtual_time(count, bitrate, server_ms / 1000)
    nodes = [f"generic@{node_id}" for node_id in range(1, count + 1)]
    with (
        tempfile.TemporaryDirectory() as folder,
        sim(*nodes, "-b", str(bitrate), "--latency", str(server_ms)) as one,
    ):
        file = Path(folder) / "many.yaml"
        file.write_text(network(count).replace("{store: true}", "{dcf: generic}"))
        before_s = one.cpu_s()
        ran = dvtcli(one, folder, bitrate, "apply", str(file))
        sim_s, sim_mb = one.cpu_s() - before_s, peak_mb(one.process.pid)
        dvtcli(one, folder, bitrate, "plan", str(file), "--exit-code")
    took_s = float(str(ran.document["seconds"]))
    return (
        f"{count:5} {bitrate // 1000:6} {server_ms:3} ms {took_s:7.2f} s {limit_s:7.2f} s {took_s / limit_s:5.2f} "
        f"{took_s / virtual_s:7.2f} "
        f"{ran.cpu_s / ran.took_s:7.0%} {sim_s / ran.took_s:6.0%} {1000 * ran.cpu_s / count:6.0f} ms "
        f"{ran.peak_mb:5.0f} MB {sim_mb:5.0f} MB"
    )


def main(counts: tuple[int, ...]) -> None:
    os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()
    print("nodes kbit/s server   apply     limit  ratio virtual  dvtcli    sim  CPU/node   peak   sim's")
    failed = False
    for count in counts:
        for bitrate in BIT_RATES:
            for server_ms in SERVERS_MS:
                try:
                    print(row(count, bitrate, server_ms), flush=True)
                except Failed as why:
                    failed = True
                    print(f"{count:5} {bitrate // 1000:6} {server_ms:3} ms {why}", flush=True)
    sys.exit(failed)


if __name__ == "__main__":
    main(tuple(map(int, sys.argv[1:])) or COUNTS)
