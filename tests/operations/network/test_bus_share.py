"""On a bus on which a machine may be running, SDO leaves the load at or below the share, and goes on nevertheless."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import partial

import pytest

from dvtcli.domain.frame_bits import frame_bits
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.operations.user.options import checked
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.harness.sample import heavy
from tests.laws.bench import dictionary
from tests.wire_timed_bus import WireTimedBus

OPERATIONAL, PRE_OPERATIONAL = b"\x05", b"\x7f"
_HEARTBEAT_S = 0.1
_OTHERS = Frame(0x1A4, bytes(8))


@dataclass(eq=False)
class _Cyclic:
    """What somebody sends every *period_s*, next at *due_s*."""

    due_s: float
    period_s: float
    frame: Frame


class BusyBus(WireTimedBus):
    """Nodes that answer at once, and another one that sends PDOs for *others* (0..1) of the time, and heartbeats."""

    def __init__(self, bitrate: int, others: float, state: bytes, server_s: float = 0.0, count: int = 4) -> None:
        ids = range(1, count + 1)
        devices = [StrictDevice(dictionary("generic"), load_family("generic"), node_id) for node_id in ids]
        for one in devices:
            one.boot_up()
            one.take_outbox()
            one.set_value(0x1017, 0, bytes(2))  # they would be more than the share of a slow bus
        pdo_s = frame_bits(_OTHERS.can_id, _OTHERS.data) / bitrate / others if others else float("inf")
        self._others = [_Cyclic(pdo_s, pdo_s, _OTHERS), _Cyclic(0.0, _HEARTBEAT_S, Frame(0x764, state))]
        #: when each frame had arrived, and its bits
        self.passed: list[tuple[float, int]] = []
        super().__init__(devices, bitrate, server_s)

    def _step(self, until_s: float) -> bool:
        other = min(self._others, key=lambda one: one.due_s)
        if other.due_s > min(until_s, self.next_s()):
            return super()._step(until_s)
        due_s = other.due_s
        self._now_s = max(self._now_s, due_s)
        other.due_s += other.period_s
        self._offer(other, other.frame, due_s)
        return True

    def _arrived(self, at_s: float, source: object, frame: Frame) -> None:
        self.passed.append((at_s, frame_bits(frame.can_id, frame.data)))
        super()._arrived(at_s, source, frame)

    def read(self, seconds: float) -> int:
        """Read as fast as it goes for so long; how many reads that were."""
        count, until_s = 0, self.now_s() + seconds
        while self.now_s() < until_s:
            self.sdo(1 + count % 4).upload(0x1000, 0)
            count += 1
        return count

    def highest_load(self) -> float:
        """The most of any second, 0..1."""
        highest = bits = 0
        window: deque[tuple[float, int]] = deque()
        for at_s, one in self.passed:
            window.append((at_s, one))
            bits += one
            while window[0][0] <= at_s - 1:
                bits -= window.popleft()[1]
            highest = max(highest, bits)
        return highest / self.wire_bitrate


@heavy
def test_reading_64_nodes_leaves_the_load_at_the_share_while_one_runs() -> None:
    bus = BusyBus(250_000, 0.3, OPERATIONAL, 0.002, count=64)
    bus.sleep(0.5)
    assert bus.nodes_seen()[0x64] is NmtState.OPERATIONAL
    read: list[int] = []

    def reads(node_id: int) -> None:
        for sub_index in range(1, 5):
            bus.sdo(node_id).upload(0x1018, sub_index)
        read.append(node_id)

    assert bus.side_by_side([partial(reads, node_id) for node_id in range(1, 65)]) == []
    assert sorted(read) == list(range(1, 65))
    assert 0.4 < bus.highest_load() <= 0.5


@pytest.mark.parametrize("bitrate", [10_000, 50_000, 250_000])
@pytest.mark.parametrize("others", [0.0, 0.3])
def test_the_load_never_exceeds_the_share_over_any_second(bitrate: int, others: float) -> None:
    bus = BusyBus(bitrate, others, OPERATIONAL)
    bus.sleep(0.5)
    assert bus.read(2.0)
    assert 0.3 < bus.highest_load() <= 0.5


def test_another_share_is_kept_to_from_the_next_request_on() -> None:
    bus = BusyBus(125_000, 0.1, OPERATIONAL)
    bus.sleep(0.5)
    bus.set_bus_share(20)
    bus.read(1.5)
    assert 0.1 < bus.highest_load() <= 0.2
    bus.set_bus_share(100)
    bus.read(1.5)
    assert bus.highest_load() > 0.9


def test_a_quiet_bus_is_not_slowed() -> None:
    counts = []
    for known in (True, False):
        bus = BusyBus(125_000, 0.0, PRE_OPERATIONAL)
        bus.sleep(0.5)
        bus.bitrate = bus.bitrate if known else None
        counts.append(bus.read(0.5))
        assert not bus._traffic._taps
    assert counts[0] == counts[1] > 200


def test_a_bus_that_is_full_without_us_lets_one_request_a_second_through() -> None:
    bus = BusyBus(125_000, 0.7, OPERATIONAL)
    bus.sleep(0.5)
    assert 3 <= bus.read(4.0) <= 6


def test_a_heartbeat_that_is_waited_for_counts_as_running_until_it_is_not() -> None:
    bus = BusyBus(125_000, 0.0, PRE_OPERATIONAL)
    bus.sleep(0.5)
    node = bus.sdo(1)
    node.download(0x1016, 1, (0x0002_00C8).to_bytes(4, "little"))
    bus.read(1.0)
    assert bus.highest_load() <= 0.5
    node.download(0x1016, 1, bytes(4))
    bus.read(1.0)
    assert bus.highest_load() > 0.9
    assert not bus._traffic._taps


def test_a_heartbeat_consumer_is_known_once_it_was_read() -> None:
    bus = BusyBus(125_000, 0.0, PRE_OPERATIONAL)
    device = bus.nodes[0].device
    device.set_value(0x1016, 1, (0x0002_00C8).to_bytes(4, "little"))
    bus.sdo(1).upload(0x1016, 1)
    bus.read(1.0)
    assert bus.highest_load() <= 0.5


@pytest.mark.parametrize("text", ["0", "101", "half", "-5"])
def test_what_is_no_share_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="1…100 %"):
        checked("bus_share", text)
    assert checked("bus_share", "35") == 35
