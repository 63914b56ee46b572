"""The dry run: what reaches the wrapped bus, and what the twin remembers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import can
import pytest

from dvtcli.bus.python_can import CanBus
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.ports import Frame
from dvtcli.errors import BusUnavailable, NoAnswer, SdoAborted, UsageError
from dvtcli.simulator.device.family import GENERIC
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.twin_bus import TwinBus
from tests.bus.devices import device, dictionary
from tests.process import PATIENCE_S
from tests.served_nodes import ServedNodes

Backing = Callable[[int, int], bytes]


class Bench:
    """A node on a virtual bus, our bus, its twin, and a third bus that records every frame."""

    def __init__(self, channel: str, family: str = "generic") -> None:
        self._recorder, ours, theirs = (can.Bus(channel, interface="virtual", ignore_config=True) for _ in range(3))
        self.node = device(1, family)
        self.real = CanBus(ours, "virtual", timeout_s=PATIENCE_S, retries=0)
        self.network = ServedNodes(theirs, [self.node])
        self.network.start()
        self.made: list[int] = []
        self.twin = TwinBus(self.real, self._device_for)

    def _device_for(self, node_id: int, backing: Backing) -> StrictDevice:
        self.made.append(node_id)
        return StrictDevice(dictionary(self.node.family.name), self.node.family, node_id, backing=backing)

    def requests(self) -> list[can.Message]:
        """Every frame from our side: all but the node's answers, boot-ups and heartbeats."""
        frames = []
        while (seen := self._recorder.recv(0.01)) is not None:
            frames.append(seen)
        return [seen for seen in frames if seen.arbitration_id & 0x780 not in {0x580, 0x700}]

    def close(self) -> None:
        self.twin.close()
        self.real.close()
        self.network.stop()
        self.network.bus.shutdown()
        self._recorder.shutdown()


@pytest.fixture
def bench(channel: str) -> Iterator[Bench]:
    bench = Bench(channel)
    yield bench
    bench.close()


def test_only_uploads_reach_the_wrapped_bus(bench: Bench) -> None:
    sdo = bench.twin.sdo(1)
    sdo.upload(0x1008, 0)  # in segments
    sdo.download(0x1800, 1, (0x80000181).to_bytes(4, "little"))
    sdo.download(0x1A00, 0, b"\0")
    with pytest.raises(SdoAborted):
        sdo.download(0x1A00, 1, bytes.fromhex("100000 5F"))
    sdo.download(0x1010, 1, b"save")
    for command in NmtCommand:
        bench.twin.send_nmt(command, 1)
        bench.twin.send_nmt(command, 0)
    bench.twin.send(Frame(0x000, bytes([NmtCommand.START, 0])))
    bench.twin.send(Frame(0x080, b""))
    bench.twin.send(Frame(0x201, bytes(8)))
    list(bench.twin.receive(0.01))
    bench.twin.nmt_state(1, 0.01)
    requests = bench.requests()
    assert requests
    assert {request.arbitration_id for request in requests} == {0x601}
    assert {request.data[0] >> 5 for request in requests} <= {2, 3, 4}  # upload, upload segment, client's abort
    assert bench.node.state is NmtState.PRE_OPERATIONAL


def test_the_node_keeps_its_values(bench: Bench) -> None:
    before = bench.real.sdo(1).upload(0x1800, 2)
    bench.twin.sdo(1).download(0x1800, 2, b"\x07")
    assert bench.twin.sdo(1).upload(0x1800, 2) == b"\x07"
    assert bench.real.sdo(1).upload(0x1800, 2) == before


def test_reset_brings_back_what_the_node_has_unless_the_twin_stored(bench: Bench) -> None:
    bench.real.sdo(1).download(0x1800, 2, b"\x03")
    twin = bench.twin.sdo(1)
    twin.download(0x1800, 2, b"\x07")
    bench.twin.send_nmt(NmtCommand.RESET_NODE, 1)
    assert twin.upload(0x1800, 2) == b"\x03"
    twin.download(0x1800, 2, b"\x07")
    twin.download(0x1010, 1, b"save")
    bench.twin.send_nmt(NmtCommand.RESET_NODE, 1)
    assert twin.upload(0x1800, 2) == b"\x07"
    assert bench.real.sdo(1).upload(0x1800, 2) == b"\x03"


def test_the_state_is_the_nodes_until_the_twin_is_commanded(bench: Bench) -> None:
    with bench.network.lock:
        bench.node.nmt(NmtCommand.START)
        bench.node.set_value(0x1017, 0, b"\x0a\0")
    assert bench.real.nmt_state(1, 1) is NmtState.OPERATIONAL
    assert bench.twin.nmt_state(1) is NmtState.OPERATIONAL
    bench.twin.send_nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
    assert bench.twin.nmt_state(1) is NmtState.PRE_OPERATIONAL
    assert bench.real.nmt_state(1, 1) is NmtState.OPERATIONAL


def test_a_command_to_all_holds_for_twins_that_come_later(bench: Bench) -> None:
    bench.twin.send_nmt(NmtCommand.STOP, 0)
    assert bench.made == []
    with pytest.raises(NoAnswer, match="STOPPED"):
        bench.twin.sdo(1).upload(0x1000, 0)
    assert bench.twin.nmt_state(1) is NmtState.STOPPED


def test_boot_ups_of_the_twin_are_seen_as_frames_too(bench: Bench) -> None:
    seen = bench.twin.boot_ups(1)
    bench.twin.send_nmt(NmtCommand.RESET_NODE, 1)
    assert [frame.can_id for frame in bench.twin.receive(0.1)] == [0x701]
    assert bench.twin.boot_ups(1) == seen + 1


def test_a_boot_up_of_the_node_itself_counts(bench: Bench) -> None:
    seen = bench.twin.boot_ups(1)
    bench.real.send_nmt(NmtCommand.RESET_NODE, 1)
    assert bench.twin.wait_boot_up(1, seen, 1)


def test_a_silent_node_is_silent_here_too(bench: Bench) -> None:
    bench.twin.set_timeout(0.1)
    with pytest.raises(NoAnswer):
        bench.twin.sdo(9).upload(0x1000, 0)
    with pytest.raises(UsageError):
        bench.twin.sdo(0)


def test_a_node_that_cannot_be_described_has_no_state(bench: Bench) -> None:
    bench.real.set_timeout(0.1)

    def unreadable(node_id: int, backing: Backing) -> StrictDevice:
        backing(0x1018, 1)
        return StrictDevice(ObjectDictionary({}), GENERIC, node_id, backing=backing)

    twin = TwinBus(bench.real, unreadable)
    twin.send_nmt(NmtCommand.START, 0)
    assert twin.nmt_state(9) is None
    assert twin.boot_ups(9) == 0


def test_a_bus_that_is_gone_is_gone_for_the_twin(bench: Bench) -> None:
    twin = bench.twin.sdo(1)
    twin.download(0x1800, 2, b"\x07")
    bench.real.close()
    assert twin.upload(0x1800, 2) == b"\x07"
    with pytest.raises(BusUnavailable):
        twin.upload(0x1000, 0)


def test_the_wrapped_bus_stays_open(bench: Bench) -> None:
    bench.twin.close()
    assert len(bench.real.sdo(1).upload(0x1000, 0)) == 4


def test_receiving_nothing_takes_its_time(bench: Bench) -> None:
    started = time.monotonic()
    assert list(bench.twin.receive(0.03)) == []
    assert time.monotonic() - started >= 0.03


def test_a_device_that_tells_its_state_in_an_object(channel: str) -> None:
    bench = Bench(channel, "gen4")
    state_object = bench.node.family.state_object
    assert state_object is not None
    with bench.network.lock:
        bench.node.state = NmtState.OPERATIONAL
    assert bench.twin.sdo(1).upload(*state_object) == bytes([NmtState.OPERATIONAL])
    bench.twin.send_nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
    assert bench.twin.sdo(1).upload(*state_object) == bytes([NmtState.PRE_OPERATIONAL])
    bench.close()


def test_a_state_that_was_forced_by_sdo_is_the_twins_own(channel: str) -> None:
    bench = Bench(channel, "gen4")
    family = bench.node.family
    assert family.master_object is not None
    assert family.state_request is not None
    bench.twin.sdo(1).download(*family.master_object, b"\1")
    bench.twin.sdo(1).download(*family.state_request, b"\0")
    assert bench.twin.nmt_state(1) is NmtState.OPERATIONAL
    assert bench.real.nmt_state(1) is NmtState.PRE_OPERATIONAL
    bench.close()
