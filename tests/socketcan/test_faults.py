"""The core of the fault and signal tests over the kernel's CAN: dvtcli beside a node, and what is left of a change."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from dvtcli.simulator.device.simulated_faults import read_faults
from tests.commands.bench import Bench
from tests.commands.bus import device
from tests.process import PATIENCE_S, start
from tests.serve.served import own_environment, wait_for
from tests.served_nodes import ServedNodes

OPTIONS = {"interface": "socketcan", "channel": "vcan0", "node": 1}
MAP = ("map", "tpdo1", "6041", "606C/32", "--sync", "1")
#: CAN-ID of an SDO request to node 1, and how a download begins (CiA 301, 7.2.4.3.3)
REQUEST, DOWNLOAD = 0x601, 1


@pytest.fixture
def link() -> Iterator[can.BusABC]:
    with can.Bus("vcan0", interface="socketcan", ignore_config=True) as bus:
        yield bus


@pytest.mark.parametrize(
    ("fault", "codes"),
    [
        ("refuse@4=0x06040041", {1}),
        ("lose-request@3", {0, 5}),
        ("lose-response@4", {0, 5}),
        ("duplicate@3", {0}),
        ("foreign@3", {0, 5}),
        ("malformed@5", {0, 5}),
        ("reset@4", {1, 5}),
    ],
)
def test_a_fault_in_the_middle_leaves_the_new_or_the_old(link: can.BusABC, fault: str, codes: set[int]) -> None:
    with ServedNodes(link, [device("gen4")], read_faults([fault], [1])), Bench((), OPTIONS) as bench:
        before = bench.run("pdo tpdo1 --json").document
        ran = bench.run(" ".join(MAP))
        assert ran.code in codes, ran.stderr
        after = bench.run("pdo tpdo1 --json").document
    assert (after == before) == (ran.code != 0), ran.stderr


@pytest.mark.parametrize(
    ("number", "step"), [(signal.SIGINT, 1), (signal.SIGTERM, 4), (signal.SIGKILL, 4), (signal.SIGKILL, 7)]
)
def test_a_signal_in_the_middle_is_taken_back_or_recovered(
    tmp_path: Path, link: can.BusABC, number: signal.Signals, step: int
) -> None:
    ready = tmp_path / "ready"
    words = ["sim", "gen4@1", "-i", "socketcan", "-c", "vcan0", "--latency", "30", "--ready-file", str(ready)]
    node = start(words, env=own_environment(tmp_path))
    wait_for(ready.exists, "the node")
    with Bench((), OPTIONS) as bench:
        before = bench.run("pdo tpdo1 --json").document
    while link.recv(0) is not None:
        pass
    words = ["-i", "socketcan", "-c", "vcan0", "-n", "1", "--yes"]
    changing = start([*words, *MAP], env=own_environment(tmp_path))
    seen = 0
    while seen < step:
        frame = link.recv(PATIENCE_S)
        assert frame is not None
        seen += frame.arbitration_id == REQUEST and frame.data[0] >> 5 == DOWNLOAD
    os.kill(changing.pid, number)
    _, errors = changing.communicate(PATIENCE_S)
    if number == signal.SIGKILL:
        assert changing.returncode == -signal.SIGKILL
        recovering = start([*words, "recover"], env=own_environment(tmp_path))
        recovering.communicate(PATIENCE_S)
        assert recovering.returncode == 0
    else:
        assert changing.returncode == 128 + number, errors
        assert "rolled back" in errors
    with Bench((), OPTIONS) as bench:
        assert bench.run("pdo tpdo1 --json").document == before
    node.send_signal(signal.SIGINT)
    node.communicate(PATIENCE_S)
