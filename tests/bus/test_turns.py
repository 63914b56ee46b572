"""Work side by side: one piece runs at a time, and each goes on where its answer has come."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import cast

import can
import pytest

from dvtcli.bus.carrier import Carrier
from dvtcli.bus.kernel_links import _SERVICES
from dvtcli.bus.message_bus import FEW_AT_ONCE, MOST_AT_ONCE
from dvtcli.bus.python_can import HEARD_S, CanBus
from dvtcli.errors import BusUnavailable, NoAnswer
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.in_process_bus import simulate
from tests.cli.commands.bus import device
from tests.harness.sample import heavy
from tests.process import PATIENCE_S
from tests.virtual_time import ANSWER_S, VirtualTimeBus

IDS = (1, 2, 3)


def devices() -> list[StrictDevice]:
    return [device("generic", node_id) for node_id in IDS]


def reads(bus: VirtualTimeBus, node_id: int, order: list[int], times: int = 3) -> Callable[[], None]:
    def read() -> None:
        for _ in range(times):
            bus.sdo(node_id).upload(0x1000, 0)
            order.append(node_id)

    return read


def test_answers_of_several_nodes_are_waited_for_together() -> None:
    bus, order = VirtualTimeBus(devices()), list[int]()
    began_s = bus.now_s()
    assert bus.side_by_side([reads(bus, node_id, order) for node_id in IDS]) == []
    assert order == [1, 2, 3] * 3
    assert bus.now_s() - began_s == pytest.approx(3 * ANSWER_S)


def test_no_more_than_may_be_asked_at_once() -> None:
    bus, order = VirtualTimeBus(devices()), list[int]()
    bus.most_at_once = 2
    assert bus.side_by_side([reads(bus, node_id, order) for node_id in IDS]) == []
    assert order == [1, 2] * 3 + [3] * 3


@heavy
def test_a_fault_lets_the_others_end_and_begins_none() -> None:
    bus, order = VirtualTimeBus(devices(), faults=[Fault.parse("1:silent@1")]), list[int]()
    bus.most_at_once = 2

    def fails() -> None:
        bus.sdo(1).download(0x1800, 5, b"\x01\0")

    (fault,) = bus.side_by_side([fails, reads(bus, 2, order, 2000), reads(bus, 3, order)])
    assert isinstance(fault, NoAnswer)
    assert order == [2] * 2000


def test_two_may_ask_one_node() -> None:
    bus, order = VirtualTimeBus(devices()), list[int]()
    assert bus.side_by_side([reads(bus, 1, order), reads(bus, 1, order)]) == []
    assert order == [1] * 6


def test_a_wait_of_time_lets_others_go_on() -> None:
    bus, order = VirtualTimeBus(devices()), list[int]()

    def sleeps() -> None:
        bus.sleep(1.0)
        order.append(0)

    assert bus.side_by_side([sleeps, reads(bus, 1, order)]) == []
    assert order == [1, 1, 1, 0]


def test_whoever_insists_tears_all_of_them_apart_and_each_may_tidy_up() -> None:
    bus, order = VirtualTimeBus(devices()), list[int]()

    def waits(node_id: int) -> Callable[[], None]:
        def wait() -> None:
            try:
                if node_id == 3:
                    os.kill(os.getpid(), signal.SIGINT)
                    while bus._turns is None or not bus._turns._torn:
                        time.sleep(0.001)
                bus.sleep(1e9)
            finally:
                bus.sdo(node_id).upload(0x1000, 0)
                order.append(node_id)

        return wait

    faults = bus.side_by_side([waits(node_id) for node_id in IDS])
    assert [type(fault) for fault in faults] == [KeyboardInterrupt] * 3
    assert order == [1, 2, 3]


def test_whoever_insists_while_nobody_waits_any_more_is_heard() -> None:
    bus = VirtualTimeBus(devices())

    def insists() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        while not bus._turns._torn:  # type: ignore[union-attr]
            time.sleep(0.001)

    (fault,) = bus.side_by_side([lambda: None, insists])
    assert isinstance(fault, KeyboardInterrupt)


def test_a_bus_that_is_closed_meanwhile_ends_all_of_them() -> None:
    with_time = simulate(devices())
    jobs = [lambda node_id=node_id: with_time.wait_boot_up(node_id, 99, 60) for node_id in IDS]
    faults = with_time.side_by_side([*jobs[:2], with_time.close])
    assert [type(fault) for fault in faults] == [BusUnavailable] * 2


def test_a_bus_with_frames_answers_side_by_side_in_real_time() -> None:
    bus, order = simulate(devices()), list[int]()
    assert bus.side_by_side([reads(bus, node_id, order, 20) for node_id in IDS]) == []  # type: ignore[arg-type]
    assert sorted(order) == [1] * 20 + [2] * 20 + [3] * 20
    bus.close()


class Filtering(Carrier):
    """Lets PDOs come or not as a link of the kernel does."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def hear(self, *, everything: bool) -> None:
        services = [{"can_id": can_id, "can_mask": mask, "extended": False} for can_id, mask in _SERVICES]
        self._bus.set_filters(None if everything else cast("can.typechecking.CanFilters", services))


def at_once(bus: CanBus, least: int = 1, of: int = 3) -> int:
    """How many *of* pieces of work are on their way at a time; they wait until *least* are."""
    until_s = bus.now_s() + PATIENCE_S
    going, most = list[int](), 0

    def works() -> None:
        nonlocal most
        going.append(0)
        most = max(most, len(going))
        bus.sleep(0.001)
        while most < least and bus.now_s() < until_s:  # a thread may begin late
            bus.sleep(0.001)
        going.pop()

    assert bus.side_by_side([works] * of) == []
    return most


def test_a_machine_that_may_run_is_not_asked_side_by_side_though_its_pdos_were_not_let_come() -> None:
    ends = [can.Bus("running", interface="virtual", ignore_config=True) for _ in range(2)]
    bus = CanBus(ends[0], "running", carrier=Filtering(ends[0]), bitrate=1_000_000)
    assert at_once(bus) == 1, "nothing was listened for yet"
    bus.sleep(HEARD_S)
    assert at_once(bus, 3) == 3, "nothing runs"
    ends[1].send(can.Message(arbitration_id=0x181, data=b"12", is_extended_id=False))
    assert at_once(bus) == 1
    ends[1].shutdown()
    bus.close()


def test_how_many_are_asked_at_once_is_decided_as_each_begins() -> None:
    ends = [can.Bus("begins", interface="virtual", ignore_config=True) for _ in range(2)]
    bus = CanBus(ends[0], "begins", carrier=Filtering(ends[0]), bitrate=1_000_000)
    going, beside, begun_s = set[int](), list[int](), list[float]()

    def works(number: int, lasts_s: float) -> Callable[[], None]:
        def work() -> None:
            beside.append(len(going))
            begun_s.append(bus.now_s())
            going.add(number)
            if len(begun_s) == MOST_AT_ONCE:
                ends[1].send(can.Message(arbitration_id=0x181, data=b"12", is_extended_id=False))
            bus.sleep(lasts_s)
            going.remove(number)

        return work

    assert bus.side_by_side([works(number, 2 * HEARD_S) for number in range(MOST_AT_ONCE + 2)]) == []
    assert begun_s[1] - begun_s[0] >= HEARD_S, "so long it is not known whether a machine runs"
    assert beside[:MOST_AT_ONCE] == list(range(MOST_AT_ONCE)), "then it is known, while the first one goes on"
    assert beside[MOST_AT_ONCE:] == [0, 0], "a PDO was received meanwhile"
    ends[1].shutdown()
    bus.close()


def test_nodes_are_asked_one_by_one_where_nothing_is_known_of_the_bit_rate() -> None:
    end = can.Bus("unknown", interface="virtual", ignore_config=True)
    bus = CanBus(end, "unknown")
    bus.receive(0)
    bus.sleep(HEARD_S)
    assert at_once(bus) == 1
    bus.bitrate = 1_000_000
    assert at_once(bus, 3) == 3
    bus.close()


def test_a_few_are_asked_at_once_over_a_server_that_does_not_tell_the_bit_rate() -> None:
    end = can.Bus("served", interface="virtual", ignore_config=True)
    bus = CanBus(end, "socketcand:127.0.0.1:29536")
    bus.receive(0)
    bus.sleep(HEARD_S)
    assert at_once(bus, FEW_AT_ONCE, 2 * FEW_AT_ONCE) == FEW_AT_ONCE
    bus.close()


def test_whoever_asks_two_nodes_hears_whether_a_machine_runs_from_then_on() -> None:
    ends = [can.Bus("two", interface="virtual", ignore_config=True) for _ in range(2)]
    bus = CanBus(ends[0], "two", carrier=Filtering(ends[0]))
    bus.sdo(1), bus.sdo(1)
    assert ends[0].filters is not None
    bus.sdo(2)
    assert ends[0].filters is None
    ends[1].shutdown()
    bus.close()
