"""What every CanopenBus keeps, whichever way the node is reached."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from itertools import pairwise

import can
import pytest

from dvtcli.bus.python_can import CanBus
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import BootUp, CanopenBus, Frame, NodeEvent
from dvtcli.errors import NoAnswer, SdoAborted
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.in_process_bus import simulate
from dvtcli.simulator.network.twin_bus import TwinBus
from tests.bus.devices import device, dictionary
from tests.harness.sample import heavy
from tests.house.laws.source_tree import SourceTree
from tests.process import PATIENCE_S
from tests.served_nodes import ServedNodes
from tests.simulator.serve.served import wait_for
from tests.virtual_time import VirtualTimeBus

SYNC = Frame(0x080, b"")
#: how long an answer may take on a busy machine, where one is wanted (s)
ANSWER_S = 20.0


class Contract:
    """Nodes 1 and 2 are generic devices, just started."""

    @pytest.fixture
    def bus(self) -> Iterator[CanopenBus]:
        raise NotImplementedError

    def test_nothing_of_its_own_hides_a_method(self, bus: CanopenBus) -> None:
        """As an attribute `_frames` would that of `MessageBus`."""
        assert [name for name in vars(bus) if callable(getattr(type(bus), name, None))] == []

    def test_name(self, bus: CanopenBus) -> None:
        assert bus.name

    def test_reads_and_writes(self, bus: CanopenBus) -> None:
        sdo = bus.sdo(1)
        assert len(sdo.upload(0x1000, 0)) == 4
        sdo.download(0x1800, 2, b"\x05")
        assert sdo.upload(0x1800, 2) == b"\x05"
        assert bus.sdo(2).upload(0x1800, 2) != b"\x05"

    def test_one_channel_a_node(self, bus: CanopenBus) -> None:
        assert bus.sdo(1) is bus.sdo(1)
        assert bus.sdo(1) is not bus.sdo(2)

    def test_aborts_carry_their_address(self, bus: CanopenBus) -> None:
        for index, sub_index, code in ((0x5FFF, 0, 0x06020000), (0x1018, 0x7F, 0x06090011)):
            with pytest.raises(SdoAborted) as caught:
                bus.sdo(2).upload(index, sub_index)
            error = caught.value
            assert (error.index, error.sub_index, error.code, error.node) == (index, sub_index, code, 2)
        with pytest.raises(SdoAborted) as caught:
            bus.sdo(2).download(0x1000, 0, bytes(4), timeout_s=ANSWER_S)
        assert caught.value.code == 0x06010002

    def test_boot_ups_are_counted_and_waited_for(self, bus: CanopenBus) -> None:
        bus.sdo(1).download(0x1800, 2, b"\x05")
        before, others = bus.boot_ups(1), bus.boot_ups(2)
        bus.send_nmt(NmtCommand.RESET_NODE, 1)
        assert bus.wait_boot_up(1, before, PATIENCE_S)
        assert bus.boot_ups(1) == before + 1
        assert bus.boot_ups(2) == others
        assert bus.nmt_state(1) is NmtState.PRE_OPERATIONAL
        assert bus.sdo(1).upload(0x1800, 2) != b"\x05"

    def test_a_boot_up_that_does_not_come(self, bus: CanopenBus) -> None:
        assert not bus.wait_boot_up(1, bus.boot_ups(1), 0.02)

    def test_reset_of_all(self, bus: CanopenBus) -> None:
        before = bus.boot_ups(1), bus.boot_ups(2)
        bus.send_nmt(NmtCommand.RESET_COMMUNICATION, 0)
        assert bus.wait_boot_up(1, before[0], PATIENCE_S)
        assert bus.wait_boot_up(2, before[1], PATIENCE_S)

    def test_what_was_stored_survives_a_reset(self, bus: CanopenBus) -> None:
        bus.sdo(1).download(0x1800, 2, b"\x05")
        bus.sdo(1).download(0x1010, 1, b"save", timeout_s=20)
        seen = bus.boot_ups(1)
        bus.send_nmt(NmtCommand.RESET_NODE, 1)
        assert bus.wait_boot_up(1, seen, PATIENCE_S)
        assert bus.sdo(1).upload(0x1800, 2) == b"\x05"

    def test_stopped_nodes_answer_no_sdo(self, bus: CanopenBus) -> None:
        bus.sdo(1).upload(0x1000, 0)
        bus.send_nmt(NmtCommand.STOP, 1)
        bus.set_timeout(0.05)
        with pytest.raises(NoAnswer) as caught:
            bus.sdo(1).upload(0x1000, 0)
        bus.set_timeout(ANSWER_S)
        assert caught.value.node == 1
        bus.send_nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
        bus.sdo(1).upload(0x1000, 0)

    def test_receive_ends(self, bus: CanopenBus) -> None:
        list(bus.receive(0.02))

    def test_sleeping_takes_that_long_of_its_own_time(self, bus: CanopenBus) -> None:
        started_s = bus.now_s()
        bus.sleep(0.05)
        bus.sleep(-1)
        assert bus.now_s() - started_s >= 0.045

    def test_what_comes_while_asleep_is_noticed(self, bus: CanopenBus) -> None:
        before, seen = bus.boot_ups(1), list[int]()
        stop = bus.tap(lambda frame, sent: None if sent else seen.append(frame.can_id))
        bus.send_nmt(NmtCommand.RESET_NODE, 1)
        wait_for(lambda: bus.sleep(0.1) or 0x701 in seen, "the boot-up")
        stop()
        assert bus.boot_ups(1) == before + 1

    def test_nothing_of_the_contract_is_missing(self, bus: CanopenBus) -> None:
        promised = {name for name in vars(CanopenBus) if not name.startswith("_")}
        assert promised == {name for name in promised if hasattr(bus, name)}

    def test_boot_ups_are_told_as_they_come(self, bus: CanopenBus) -> None:
        told: list[NodeEvent] = []
        bus.nodes_seen()
        stop = bus.on_event(told.append)
        for _ in range(2):
            before = bus.boot_ups(2)
            bus.send_nmt(NmtCommand.RESET_NODE, 2)
            assert bus.wait_boot_up(2, before, PATIENCE_S)
            stop()
            stop = bus.on_event(lambda _event: None)
        assert [event.node_id for event in told if isinstance(event, BootUp)] == [2]

    def test_who_was_reset_is_heard(self, bus: CanopenBus) -> None:
        before = bus.boot_ups(2)
        bus.send_nmt(NmtCommand.RESET_NODE, 2)
        assert bus.wait_boot_up(2, before, PATIENCE_S)
        assert bus.nodes_seen()[2] is NmtState.PRE_OPERATIONAL
        assert 9 not in bus.nodes_seen()

    def test_the_time_out_holds_from_now_on(self, bus: CanopenBus) -> None:
        bus.set_timeout(0.03)
        with pytest.raises(NoAnswer) as caught:
            bus.sdo(9).upload(0x1000, 0)
        assert "within 0.03 s" in caught.value.text

    def test_a_quiet_bus_has_nothing_to_complain_about(self, bus: CanopenBus) -> None:
        bus.sdo(1).upload(0x1000, 0)
        bus.idle(0.01)
        assert (bus.disturbances(), bus.error_frame_count(), bus.emergency(1), bus.bitrate) == ([], 0, None, None)

    def test_close_may_be_repeated(self, bus: CanopenBus) -> None:
        bus.sdo(1).upload(0x1000, 0)
        bus.close()
        bus.close()


class CarriesFrames(Contract):
    """What is kept besides where CAN frames pass."""

    def test_it_says_so(self, bus: CanopenBus) -> None:
        assert bus.carries_frames

    def test_sync_brings_a_synchronous_tpdo(self, bus: CanopenBus) -> None:
        sdo = bus.sdo(1)
        sdo.download(0x1800, 1, (0x80000181).to_bytes(4, "little"))
        sdo.download(0x1800, 2, b"\x01")
        sdo.download(0x1A00, 0, b"\x00")
        sdo.download(0x1A00, 1, (0x10010008).to_bytes(4, "little"))
        sdo.download(0x1A00, 0, b"\x01")
        sdo.download(0x1800, 1, (0x40000181).to_bytes(4, "little"))
        bus.send_nmt(NmtCommand.START, 1)
        bus.send(SYNC)
        came = (frame.data for frame in bus.receive(PATIENCE_S) if frame.can_id == 0x181)
        assert next(came) == b"\x00"

    def test_who_taps_sees_each_frame_until_it_ends(self, bus: CanopenBus) -> None:
        seen: list[tuple[int, bool]] = []
        stop = bus.tap(lambda frame, sent: seen.append((frame.can_id, sent)))
        bus.sdo(1).upload(0x1000, 0)
        before = bus.boot_ups(1)
        bus.send(SYNC)
        bus.send_nmt(NmtCommand.RESET_NODE, 1)
        assert bus.wait_boot_up(1, before, PATIENCE_S)
        assert (0x080, True) in seen
        assert (0x701, False) in seen
        stop()
        seen.clear()
        bus.send(SYNC)
        assert seen == []


class TestCanBus(CarriesFrames):
    @pytest.fixture
    def bus(self, channel: str) -> Iterator[CanopenBus]:
        ours, theirs = (can.Bus(channel, interface="virtual", ignore_config=True) for _ in range(2))
        bus = CanBus(ours, "virtual", timeout_s=ANSWER_S, retries=0)
        with ServedNodes(theirs, [device(1), device(2)]):
            yield bus
        bus.close()
        theirs.shutdown()

    def test_is_no_simulation(self, bus: CanopenBus) -> None:
        assert not bus.simulated


class Late(StrictDevice):
    """Takes its time, as a machine does that has other work."""

    def upload(self, index: int, sub_index: int) -> bytes:
        time.sleep(0.3)
        return super().upload(index, sub_index)


class TestSimulation(CarriesFrames):
    @pytest.fixture
    def bus(self) -> Iterator[CanopenBus]:
        bus = simulate([device(1), device(2)], timeout_s=ANSWER_S, retries=0)
        yield bus
        bus.close()

    def test_is_a_simulation_and_saw_the_nodes_start(self, bus: CanopenBus) -> None:
        assert bus.simulated
        assert (bus.boot_ups(1), bus.boot_ups(2), bus.boot_ups(3)) == (1, 1, 0)

    def test_simulations_do_not_meet(self, bus: CanopenBus) -> None:
        other = simulate([device(3)])
        assert bus.boot_ups(3) == 0
        other.close()

    def test_nodes_on_a_slow_machine_are_not_silent(self) -> None:
        bus = simulate([Late(device(1).dictionary, device(1).family, 1)], timeout_s=0.05)
        try:
            assert bus.sdo(1).upload(0x1000, 0, retries=0) == device(1).upload(0x1000, 0)
            with pytest.raises(NoAnswer):
                bus.sdo(9).upload(0x1000, 0, retries=0)
        finally:
            bus.close()

    def test_what_nodes_do_while_nobody_reads_has_its_own_time(self, bus: CanopenBus) -> None:
        bus.sdo(1).download(0x1017, 0, (20).to_bytes(2, "little"))
        time.sleep(0.3)
        beats: list[float] = []
        stop = bus.tap(lambda frame, _sent: beats.append(frame.timestamp_s))
        bus.boot_ups(1)
        stop()
        assert len(beats) >= 14
        assert [round(later - one, 6) for one, later in pairwise(beats)] == [0.02] * (len(beats) - 1)

    @heavy
    def test_a_thread_that_waits_hears_what_another_s_frame_brings(self, bus: CanopenBus) -> None:
        """Every answer goes to whom it belongs, whoever reads."""
        expected = {node_id: bus.sdo(node_id).upload(0x1018, 4) for node_id in (1, 2)}
        wrong: list[bytes] = []

        def read(node_id: int) -> None:
            for _ in range(1000):
                answer = bus.sdo(node_id).upload(0x1018, 4)
                if answer != expected[node_id]:
                    wrong.append(answer)

        threads = [threading.Thread(target=read, args=(node_id,)) for node_id in (1, 2, 1, 2)]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            bus.idle(0.02)
        assert not wrong

    def test_closing_leaves_no_thread(self) -> None:
        before = set(threading.enumerate())
        buses = [simulate([device(1)]) for _ in range(5)]
        for bus in buses:
            bus.close()
        assert set(threading.enumerate()) <= before


class TestVirtualTime(CarriesFrames):
    @pytest.fixture
    def bus(self) -> Iterator[CanopenBus]:
        bus = VirtualTimeBus([device(1), device(2)], timeout_s=ANSWER_S, retries=0)
        yield bus
        bus.close()


class TestTwin(CarriesFrames):
    @pytest.fixture
    def bus(self) -> Iterator[CanopenBus]:
        real = simulate([device(1), device(2)], timeout_s=ANSWER_S, retries=0)
        bus = TwinBus(
            real,
            lambda node_id, backing: StrictDevice(
                dictionary("generic"), device(node_id).family, node_id, backing=backing
            ),
        )
        yield bus
        bus.close()
        real.close()


@heavy
@pytest.mark.together
def test_who_uses_a_bus_does_not_know_of_which_kind_it_is() -> None:
    """Only who opens one does; everybody else has the contract."""
    arrows = SourceTree.of_the_package().house.arrows
    knowing = {arrow.source for arrow in arrows if arrow.target == "bus/python_can.py"}
    assert knowing == {"bus/opening.py"}
