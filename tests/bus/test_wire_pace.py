"""Many nodes asked at once on a wire that takes time: no frame waits long for a gap, and little of it is wasted."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.bus.bus_share import AHEAD_S, LONGEST_WAIT_S, WirePace
from dvtcli.bus.message_bus import FEW_AT_ONCE
from dvtcli.bus.python_can import LEAST_BIT_RATE
from dvtcli.bus.sdo.sdo_link import DEFAULT_TIMEOUT_S
from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.frame_bits import frame_bits
from dvtcli.domain.ports import Frame
from tests.cli.commands.bus import device
from tests.harness.sample import heavy
from tests.wire_timed_bus import WireTimedBus

HEARTBEAT_ID, HEARTBEAT_S = 0x700, 0.1
OBJECTS = ((0x1000, 0), (0x1018, 1), (0x1018, 2), (0x1018, 4))


def nodes(count: int, bitrate: int, server_s: float) -> WireTimedBus:
    """A bus of *count* nodes with heartbeats every 0.1 s, which are the last that get on the wire."""
    devices = [device("generic", node_id) for node_id in range(1, count + 1)]
    for one in devices:
        one.boot_up()
        one.set_value(0x1017, 0, int(1000 * HEARTBEAT_S).to_bytes(2, "little"))
    bus = WireTimedBus(devices, bitrate, server_s)
    bus.sleep(0.5)
    return bus


def reads(bus: WireTimedBus, node_id: int, until_s: float) -> Callable[[], None]:
    def read() -> None:
        again = True
        while again:
            for index, sub_index in OBJECTS:
                bus.sdo(node_id).upload(index, sub_index, retries=0)
            again = bus.now_s() < until_s

    return read


@heavy
@pytest.mark.parametrize(("count", "bitrate"), [(16, 125_000), (16, 250_000), (64, 250_000), (127, 500_000)])
def test_no_node_starves_behind_those_with_lower_can_ids(count: int, bitrate: int) -> None:
    bus = nodes(count, bitrate, 0.002)
    bus.begin()
    began_s = bus.now_s()
    until_s = began_s + 0.5
    assert bus.side_by_side([reads(bus, node_id, until_s) for node_id in range(1, count + 1)]) == []
    heartbeats = [waited_s for can_id, waited_s in bus.waited_s.items() if can_id > HEARTBEAT_ID]
    answers = [waited_s for can_id, waited_s in bus.waited_s.items() if SDO_RESPONSE_BASE < can_id < SDO_REQUEST_BASE]
    assert len(heartbeats) == len(answers) == count
    assert max(heartbeats) < 1.5 * HEARTBEAT_S
    assert max(answers) < DEFAULT_TIMEOUT_S / 3
    assert bus.bits / bus.wire_bitrate > 0.94 * (bus.now_s() - began_s), "the wire is used"


@heavy
@pytest.mark.parametrize("bitrate", [LEAST_BIT_RATE, 500_000])
def test_a_few_leave_gaps_where_nobody_said_the_bit_rate(bitrate: int) -> None:
    bus = nodes(16, bitrate, 0.002)
    bus.bitrate, bus.unknown_pace, bus.most_at_once = None, LEAST_BIT_RATE, FEW_AT_ONCE
    bus.begin()
    until_s = bus.now_s() + 0.8
    assert bus.side_by_side([reads(bus, node_id, until_s) for node_id in range(1, FEW_AT_ONCE + 1)]) == []
    heartbeats = [waited_s for can_id, waited_s in bus.waited_s.items() if can_id > HEARTBEAT_ID]
    assert len(heartbeats) == 16
    assert max(heartbeats) < 1.5 * HEARTBEAT_S


@heavy
def test_without_a_pace_they_would() -> None:
    bus = nodes(16, 250_000, 0.002)
    bus.bitrate = None
    bus.begin()
    until_s = bus.now_s() + 0.8
    bus.side_by_side([reads(bus, node_id, until_s) for node_id in range(1, 17)])
    assert max(bus.waited_s.values()) > DEFAULT_TIMEOUT_S


def test_who_asks_one_node_after_the_other_is_not_paced() -> None:
    bus = nodes(2, 125_000, 0.0)
    for node_id in (1, 2):
        reads(bus, node_id, bus.now_s() + 0.1)()
        assert not bus._traffic._taps
    assert bus.side_by_side([reads(bus, node_id, bus.now_s() + 0.1) for node_id in (1, 2)]) == []
    assert not bus._traffic._taps, "nothing is counted any more"


class Passing:
    """A wire of *bit_rate* bit/s of which only the pace and the clock are real: each frame passes when it may."""

    def __init__(self, bit_rate: int) -> None:
        self.bit_rate, self.time_s, self.bits = bit_rate, 0.0, 0
        self.pace = WirePace(bit_rate, lambda: self.time_s)

    def passes(self, frame: Frame, sent: bool) -> None:
        self.bits += frame_bits(frame.can_id, frame.data)
        self.pace.count(frame, sent)

    def exchange(self, node_id: int, request: bytes, answer: bytes | None) -> None:
        self.time_s = max(self.time_s, self.pace.slot_s())
        self.passes(Frame(SDO_REQUEST_BASE + node_id, request), True)
        if answer is not None:
            self.passes(Frame(SDO_RESPONSE_BASE + node_id, answer), False)


_DATA = st.binary(min_size=8, max_size=8).filter(lambda data: data[0] != 0x80)
_EXCHANGES = st.lists(st.tuples(st.integers(1, 127), _DATA, st.none() | _DATA), min_size=10, max_size=30)


@given(_EXCHANGES, st.sampled_from([10_000, 125_000, 1_000_000]))
def test_what_passes_is_never_more_than_the_wire_carries(
    exchanges: list[tuple[int, bytes, bytes | None]], bit_rate: int
) -> None:
    """By whatever frames, answered or not; and what is counted too long is put right when it has passed."""
    wire = Passing(bit_rate)
    for node_id, request, answer in exchanges:
        wire.exchange(node_id, request, answer)
    most = 2 * 135 / bit_rate
    assert wire.bits / bit_rate <= 0.95 * (wire.time_s + AHEAD_S) + most
    unanswered = sum(answer is None for _, _, answer in exchanges)
    wasted_s = unanswered * most / 2 / 0.95
    assert wire.time_s <= wire.bits / bit_rate / 0.95 + wasted_s + most


def test_whoever_asks_first_is_first() -> None:
    pace = WirePace(125_000, lambda: 0.0)
    slots = [pace.slot_s() for _ in range(10)]
    assert slots == sorted(slots)
    assert slots[:2] == [0.0, pytest.approx(270 / 125_000 / 0.95 - AHEAD_S)]


def test_a_bus_that_others_fill_lets_requests_through_nevertheless() -> None:
    wire = Passing(125_000)
    for _ in range(5000):
        wire.passes(Frame(0x181, bytes(8)), False)
    assert wire.pace.slot_s() <= LONGEST_WAIT_S


@pytest.mark.parametrize("frame", [Frame(0x605, b""), Frame(0x605, b"", remote=True)])
def test_a_frame_without_data_is_no_request(frame: Frame) -> None:
    """Others may send any frame meanwhile; no answer is owed to it."""
    pace = WirePace(125_000, lambda: 0.0)
    pace.count(frame, True)
    assert pace.slot_s() == 0.0
