"""SDO block transfers of our own client with the strict device: right data or an error, whatever happens on the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError, NoAnswer, SdoAborted
from dvtcli.simulator.device.simulated_faults import read_faults
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from dvtcli.simulator.network.station import BLOCK_PATIENCE_S
from tests.benchmarks.bench_blocks import measure
from tests.bus.devices import dictionary
from tests.virtual_time import ANSWER_S, VirtualTimeBus

TEXT = 0x2002
SIZES = (1, 4, 5, 7, 127, 128, 133, 134, 888, 889, 890, 1778, 1779, 5000)
REQUEST, ANSWER = 0x601, 0x581


def pattern(size: int) -> bytes:
    return bytes(count * 7 % 251 for count in range(size))


def device(**differing: Any) -> StrictDevice:
    return StrictDevice(dictionary("generic"), load_family("generic")._replace(**differing), 1)


class Line(VirtualTimeBus):
    """A bus on which the SDO frames with the numbers of *faults* are lost, doubled, wrong, or come later than the next.

    Those of nodes and ours are counted together, from 0.
    """

    def __init__(self, node: StrictDevice, faults: Mapping[int, str] | None = None, **options: Any) -> None:
        self.faults: Mapping[int, str] = {}
        self.count, self.held, self.in_blocks = 0, None, False
        self.frames: list[tuple[int, bytes]] = []
        super().__init__([node], **options)
        self.node, self.faults = node, faults or {}

    def _passed(self, frame: Frame) -> list[Frame]:
        if frame.can_id not in (REQUEST, ANSWER):
            return [frame]
        self.frames.append((frame.can_id, frame.data))
        fault = self.faults.get(self.count)
        self.count += 1
        in_block, self.in_blocks = self.in_blocks, self._follow(frame)
        match fault:
            case "lost":
                return []
            case "doubled":
                return [frame, frame]
            case "wrong" if in_block:
                return [frame._replace(data=frame.data[:5] + bytes([frame.data[5] ^ 0x10]) + frame.data[6:])]
        return [frame]

    def _follow(self, frame: Frame) -> bool:
        """Whether segments of a block transfer follow, as far as can be told from outside: they may look like this."""
        if frame.can_id == REQUEST and frame.data[0] in (0xA4, 0xC6):
            return True
        return self.in_blocks and not (frame.can_id == REQUEST and frame.data[0] in (0x40, 0x21, 0x80))

    def _send(self, frame: Frame) -> None:
        late, self.held = self.held, None
        if late is None and self.faults.get(self.count) == "late" and frame.can_id == REQUEST:
            self.held = frame
            self.count += 1
            return
        for one in [*self._passed(frame), *([late] if late else [])]:
            super()._send(one)

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        late = frame.can_id == ANSWER and self.faults.get(self.count) == "late"
        for one in self._passed(frame):
            super()._to_us(one, delay_s + 0.003 if late else delay_s)

    def requests(self) -> list[int]:
        return [data[0] for can_id, data in self.frames if can_id == REQUEST]


@pytest.mark.parametrize(
    "differing", [{}, {"block_size": 1}, {"block_size": 5}, {"block_crc": False}, {"block_size": 0}]
)
@pytest.mark.parametrize("size", SIZES)
def test_both_ways(size: int, differing: dict[str, Any]) -> None:
    line = Line(device(**differing))
    line.sdo(1).download(TEXT, 0, pattern(size))
    assert line.node.value(TEXT) == pattern(size)
    assert line.sdo(1).upload(TEXT, 0) == pattern(size)
    assert not line.disturbances()


def test_from_128_bytes_on_it_goes_by_blocks() -> None:
    for size, starts in ((127, {0x21, 0x40}), (128, {0xC6, 0x40, 0xA4})):
        line = Line(device())
        line.sdo(1).download(TEXT, 0, pattern(size))
        line.sdo(1).upload(TEXT, 0)
        assert set(line.requests()) & {0x21, 0x40, 0xC6, 0xA4} == starts


def test_a_device_without_blocks_is_asked_once() -> None:
    line = Line(device(block_size=0))
    for _ in range(3):
        line.sdo(1).download(TEXT, 0, pattern(200))
        assert line.sdo(1).upload(TEXT, 0) == pattern(200)
    assert line.requests().count(0xC6) == 1
    assert line.requests().count(0xA4) == 0


def test_while_a_machine_may_run_its_bus_is_not_filled() -> None:
    node = device()
    line = Line(node)
    node.nmt(1)
    line.sleep(1.1)  # its heartbeat
    line.sdo(1).download(TEXT, 0, pattern(200))
    assert line.sdo(1).upload(TEXT, 0) == pattern(200)
    assert not {0xC6, 0xA4} & set(line.requests())


@pytest.mark.parametrize("crc", [True, False])
@pytest.mark.parametrize("fault", ["lost", "doubled", "late"])
@pytest.mark.parametrize("number", range(0, 300, 13))
def test_one_fault_of_a_download(number: int, fault: str, crc: bool) -> None:
    line = Line(device(block_crc=crc, block_size=100), {number: fault})
    right_or_error(line, pattern(2000))


def right_or_error(line: Line, data: bytes) -> None:
    """What is written or read is right, or an error says that it is not; and afterwards all is well."""
    possible, state = {line.node.value(TEXT), data}, "done"
    try:
        line.sdo(1).download(TEXT, 0, data)
        possible = {data}
    except DvtcliError as failed:
        state = failed.state
    assert state in ("done", "unknown", "unchanged")
    assert line.node.value(TEXT) in possible
    held = line.node.value(TEXT)
    abort = 0x0500_0000
    try:
        read = line.sdo(1).upload(TEXT, 0)
    except NoAnswer:
        pass
    except SdoAborted as refused:  # a doubled request has the toggle bit of the one before
        abort = refused.code
    else:
        assert read == held
    assert abort >> 24 == 0x05, "it is about the transfer"
    line.faults = {}
    line.sleep(BLOCK_PATIENCE_S + 1)
    line.sdo(1).download(TEXT, 0, data[::-1])
    assert line.sdo(1).upload(TEXT, 0) == data[::-1]


FAULTS = st.sampled_from(["lost", "doubled", "late", "wrong"])


@settings(deadline=None)
@given(data=st.data())
def test_right_data_or_an_error(data: st.DataObject) -> None:
    size = data.draw(st.integers(1, 4000))
    faults = data.draw(st.dictionaries(st.integers(0, 4 + size // 3), FAULTS, max_size=6))
    differing = data.draw(st.sampled_from([{}, {"block_size": 3}, {"block_size": 0}]))
    right_or_error(Line(device(**differing), faults), pattern(size))


@settings(deadline=None)
@given(data=st.data())
def test_right_data_or_an_error_without_a_crc(data: st.DataObject) -> None:
    size = data.draw(st.integers(1, 4000))
    kinds = st.sampled_from(["lost", "doubled", "late"])  # nothing would tell of a wrong byte
    faults = data.draw(st.dictionaries(st.integers(0, 4 + size // 3), kinds, max_size=6))
    block_size = data.draw(st.sampled_from([127, 3]))
    right_or_error(Line(device(block_crc=False, block_size=block_size), faults), pattern(size))


@pytest.mark.counted
def test_large_ones(pytestconfig: pytest.Config) -> None:
    size = pytestconfig.getoption("block_bytes")
    faults = {number: ("lost", "doubled", "late", "wrong")[number // 997 % 4] for number in range(500, size // 4, 997)}
    right_or_error(Line(device(), faults), pattern(size))


def test_more_than_a_mebibyte_is_refused_by_the_device() -> None:
    line = Line(device())
    with pytest.raises(SdoAborted) as caught:
        line.sdo(1).download(TEXT, 0, bytes((1 << 20) + 1))
    assert caught.value.code == 0x05040005


class Interrupted(Line):
    """Ctrl-C comes with frame number *at*."""

    at = 1 << 30

    def _passed(self, frame: Frame) -> list[Frame]:
        if self.count >= self.at:
            self.at = 1 << 30
            raise KeyboardInterrupt
        return super()._passed(frame)


@pytest.mark.parametrize("at", [1, 5, 150, 286])
def test_ctrl_c_aborts_a_download(at: int) -> None:
    line = Interrupted(device())
    line.at = at
    with pytest.raises(KeyboardInterrupt):
        line.sdo(1).download(TEXT, 0, pattern(2000))
    assert line.frames[-1][1] == bytes.fromhex("80 02 20 00 00 00 00 08")
    assert line.node.value(TEXT) == device().value(TEXT)
    right_or_error(line, pattern(2000))


@pytest.mark.parametrize("at", [6, 100, 200])
def test_ctrl_c_aborts_an_upload(at: int) -> None:
    line = Interrupted(device())
    line.node.set_value(TEXT, 0, pattern(2000))
    line.at = at
    with pytest.raises(KeyboardInterrupt):
        line.sdo(1).upload(TEXT, 0)
    assert (REQUEST, bytes.fromhex("80 02 20 00 00 00 00 08")) in line.frames
    assert line.sdo(1).upload(TEXT, 0) == pattern(2000)


def test_a_server_that_stops_is_no_answer() -> None:
    node = device()
    line = Line(node, faults=dict.fromkeys(range(200, 10000), "lost"))
    with pytest.raises(NoAnswer) as caught:
        line.sdo(1).download(TEXT, 0, pattern(5000))
    assert caught.value.state == "unknown"
    with pytest.raises(NoAnswer):
        line.sdo(1).upload(TEXT, 0)


def test_a_restart_in_the_middle_is_no_answer_at_once() -> None:
    node = device()
    line = Line(node)
    sent = 0

    def count(frame: Frame, ours: bool) -> None:
        nonlocal sent
        sent += ours
        if sent == 60:
            node.restart()
            line.nodes[0].server.reset()
            node.boot_up()

    line.tap(count)
    with pytest.raises(NoAnswer):
        line.sdo(1).download(TEXT, 0, pattern(1000), timeout_s=100)
    assert line.now_s() < 10


def test_faults_at_a_download_count_block_downloads() -> None:
    line = VirtualTimeBus([device()], faults=read_faults(["refuse@2=0x08000000"], [1]))
    line.sdo(1).download(TEXT, 0, pattern(3000))
    with pytest.raises(SdoAborted) as caught:
        line.sdo(1).download(TEXT, 0, pattern(3000))
    assert caught.value.code == 0x08000000


@pytest.mark.counted
def test_the_bus_is_used_to_nine_tenths_of_what_its_bits_allow(pytestconfig: pytest.Config) -> None:
    """At 500 kbit/s, with a device that takes 0.5 ms to answer; segments use less than half of it."""
    size = pytestconfig.getoption("block_bytes")
    assert all(one.used >= 0.9 for one in measure(size))
    assert all(one.used < 0.6 for one in measure(min(size, 20_000), block_size=0))
