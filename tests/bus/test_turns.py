"""Work side by side: one piece runs at a time, and each goes on where its answer has come."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

import pytest

from dvtcli.errors import BusUnavailable, NoAnswer
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.in_process_bus import simulate
from tests.commands.bus import device
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
