"""Nodes on one bus whose time is passed in: no thread, no clock."""

from __future__ import annotations

from itertools import pairwise

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.network.in_process_bus import NodesOnABus
from tests.simulator.bench import booted

START_NODES = Frame(0x000, b"\x01\x00")


class Bench:
    """Generic nodes *node_ids*, booted at 10 s; what they say, with its time."""

    def __init__(self, *node_ids: int, faults: tuple[str, ...] = ()) -> None:
        self.said: list[tuple[float, Frame]] = []
        devices = [booted("generic", node_id) for node_id in node_ids]
        words = [Fault.parse(word) for word in faults]
        self.nodes = NodesOnABus(devices, words, (), lambda frame, at_s: self.said.append((at_s, frame)))
        self.nodes.boot(10.0)

    def download(self, node_id: int, request: str, at_s: float) -> list[tuple[float, Frame]]:
        """What is said until the request to *node_id* is answered."""
        self.said.clear()
        self.nodes.hear(Frame(0x600 + node_id, bytes.fromhex(request)), at_s)
        return list(self.said)

    def times(self, can_id: int) -> list[float]:
        return [at_s for at_s, frame in self.said if frame.can_id == can_id]


def heartbeat(period_ms: int) -> str:
    return f"2b171000{period_ms.to_bytes(2, 'little').hex()}0000"


def test_boot_ups_are_said_at_once() -> None:
    said = Bench(1, 2).said
    assert {at_s for at_s, _ in said} == {10.0}
    assert [frame.can_id for _, frame in said if frame.data == b"\0"] == [0x701, 0x702]


def test_an_answer_is_there_on_return() -> None:
    answer_at, answer = Bench(1).download(1, "4000100000000000", 11.0)[-1]
    assert (answer_at, answer.can_id) == (11.0, 0x581)


def test_what_was_due_happens_at_its_time_before_what_is_heard() -> None:
    bench = Bench(1, 2)
    bench.download(1, heartbeat(100), 11.0)
    bench.download(2, "4000100000000000", 12.05)
    beats = bench.times(0x701)
    assert bench.times(0x582) == [12.05]
    assert [round(later - one, 6) for one, later in pairwise(beats)] == [0.1] * (len(beats) - 1)
    assert beats[-1] == pytest.approx(12.0)


def test_a_late_answer_comes_at_its_time() -> None:
    bench = Bench(1, faults=("late@1=0.6",))
    assert not [frame for _, frame in bench.download(1, heartbeat(0), 11.0) if frame.can_id == 0x581]
    assert bench.nodes.next_s() == pytest.approx(11.6)
    bench.nodes.pass_time(20.0)
    assert bench.times(0x581) == [pytest.approx(11.6)]


def test_a_node_that_was_left_alone_for_an_hour_does_not_make_up_for_all_of_it() -> None:
    bench = Bench(1)
    bench.download(1, heartbeat(1), 11.0)
    bench.said.clear()
    bench.nodes.pass_time(3611.0)
    beats = bench.times(0x701)
    assert len(beats) <= 1001
    assert beats[-1] == 3611.0
    assert bench.nodes.next_s() == pytest.approx(3611.001)


def test_nothing_is_due_of_a_silent_node() -> None:
    bench = Bench(1)
    bench.download(1, heartbeat(0), 11.0)
    assert bench.nodes.next_s() == float("inf")


def test_nodes_that_answer_each_other_for_ever_rest() -> None:
    """Each takes the other's TPDO for a SYNC, and answers it with its own."""
    bench = Bench(1, 2)
    for node in bench.nodes.nodes:
        node.device.download(0x1800, 1, (0xC000_0180 + node.device.node_id).to_bytes(4, "little"))
        node.device.download(0x1800, 2, b"\x01")
        node.device.download(0x1800, 1, (0x4000_0080).to_bytes(4, "little"))
    bench.nodes.hear(START_NODES, 11.0)
    bench.said.clear()
    bench.nodes.hear(Frame(0x080, b""), 11.0)
    assert 100 < len(bench.said) < 2000
    before = len(bench.said)
    bench.nodes.pass_time(11.01)
    assert len(bench.said) == before
    assert bench.nodes.next_s() == pytest.approx(11.02)
    bench.nodes.pass_time(11.02)
    assert len(bench.said) > before
    assert any(frame.can_id == 0x581 for _, frame in bench.download(1, "4000100000000000", 11.03))
