"""The core of the fault and signal tests over the kernel's CAN: dvtcli beside a node, and what is left of a change."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue

import can
import pytest

from dvtcli.simulator.device.simulated_faults import read_faults
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.harness.forked import Forked
from tests.process import PATIENCE_S, start
from tests.served_nodes import ServedNodes
from tests.simulator.serve.served import own_environment
from tests.socketcan.conftest import ANSWER_S

OPTIONS = {"interface": "socketcan", "channel": "vcan0", "node": 1, "timeout": 2.0}
MAP = ("map", "tpdo1", "6041", "606C/32", "--sync", "1")
#: CAN-ID of an SDO request to node 1, and how a download begins (CiA 301, 7.2.4.3.3)
REQUEST, DOWNLOAD = 0x601, 1


class Striking(can.BusABC):
    """*link* as nodes have it, to whom something happens: *strike* with the SDO download *step* to node 1."""

    def __init__(self, link: can.BusABC, step: int, strike: Callable[[], None]) -> None:
        super().__init__(link.channel_info)
        self._link, self._left, self._strike = link, step, strike

    def recv(self, timeout: float | None = None) -> can.Message | None:
        frame = self._link.recv(timeout)
        if frame is not None and frame.arbitration_id == REQUEST and frame.data[0] >> 5 == DOWNLOAD:
            self._left -= 1
            if not self._left:
                self._strike()
        return frame

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._link.send(msg, timeout)


@pytest.fixture(params=["vcan0"])
def link(request: pytest.FixtureRequest) -> Iterator[can.BusABC]:
    with can.Bus(request.param, interface="socketcan", ignore_config=True) as bus:
        yield bus


@pytest.mark.parametrize("link", ["vcan0", "can1"], indirect=True)
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
    options = OPTIONS | {"channel": "can0" if "can1" in str(link.channel_info) else "vcan0"}
    with ServedNodes(link, [device("gen4")], read_faults([fault], [1])), Bench((), options) as bench:
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
    """It comes with the SDO download *step*, before the node has that."""
    changing: SimpleQueue[Forked] = SimpleQueue()
    struck = Striking(link, step, lambda: changing.get(timeout=PATIENCE_S).send_signal(number))
    words = ["-i", "socketcan", "-c", "vcan0", "-n", "1", "--timeout", str(ANSWER_S), "--yes"]
    with struck, ServedNodes(struck, [device("gen4")]):
        with Bench((), OPTIONS) as bench:
            before = bench.run("pdo tpdo1 --json").document
        process = start([*words, *MAP], env=own_environment(tmp_path))
        changing.put(process)
        _, errors = process.communicate(PATIENCE_S)
        if number == signal.SIGKILL:
            assert process.returncode == -signal.SIGKILL
            recovering = start([*words, "recover"], env=own_environment(tmp_path))
            recovering.communicate(PATIENCE_S)
            assert recovering.returncode == 0
        else:
            assert process.returncode == 128 + number, errors
            assert "rolled back" in errors
        with Bench((), OPTIONS) as bench:
            assert bench.run("pdo tpdo1 --json").document == before
