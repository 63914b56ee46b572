"""What was there in time is no time-out, however late it is read: a busy machine is no silent node."""

from __future__ import annotations

import os
import subprocess
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import islice
from time import monotonic, sleep

import can
import pytest
from can.interfaces.virtual import VirtualBus

from dvtcli.bus.python_can import HEARD_S, CanBus
from dvtcli.bus.receiver import BACKLOG
from dvtcli.errors import NoAnswer
from tests.bus.scripted import Lockstep, Server, well_behaved
from tests.posix import needs_signals

NODES = (4, 5, 6, 7)


class Preempted(Lockstep):
    """A driver whose thread gets the processor late, as on a busy machine: *read_s* to read, *send_s* to send."""

    read_s = send_s = 0.0

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if timeout:
            sleep(self.read_s)
        return super()._recv_internal(timeout)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        sleep(self.send_s)
        super().send(msg, timeout)


def some_answer(request: bytes) -> list[bytes]:
    """Nodes 4 to 7 answer late, but in time; the others, who ask for the object 0x1001, do not."""
    sleep(0.005)
    return [] if request[1:3] == b"\x01\x10" else well_behaved(request)


@pytest.fixture
def driver(channel: str) -> Preempted:
    return Preempted(channel)


@pytest.fixture
def bus(driver: Preempted, channel: str) -> Iterator[CanBus]:
    made = CanBus(driver, "virtual", timeout_s=0.05, retries=0)
    server = driver.server = Server(channel, some_answer)
    yield made
    made.close()
    server.stop()


def asked(bus: CanBus, *nodes: int) -> list[bytes | None]:
    """What each of *nodes* answers, asked by a thread each, at once."""
    together = threading.Barrier(len(nodes))

    def ask(node: int) -> bytes | None:
        together.wait()
        try:
            return bus.sdo(node).upload(0x1000 if node in NODES else 0x1001, 0)
        except NoAnswer:
            return None

    with ThreadPoolExecutor(len(nodes)) as pool:
        return list(pool.map(ask, nodes))


def test_each_of_many_has_its_whole_time_though_the_one_that_reads_is_late(bus: CanBus, driver: Preempted) -> None:
    driver.read_s = 0.12
    for _ in range(3):
        assert None not in asked(bus, *NODES)


def test_who_is_silent_is_silent_beside_those_that_answer(bus: CanBus, driver: Preempted) -> None:
    for driver.read_s in (0.0, 0.12):
        first, nobody, second, still_nobody = asked(bus, 4, 40, 5, 41)
        assert (first is None, second is None, nobody, still_nobody) == (False, False, None, None)


def test_a_bus_that_is_never_quiet_does_not_hold_anyone_for_ever(bus: CanBus, channel: str) -> None:
    """Nothing but traffic: those who wait for a silent node are told so, too."""
    stop = threading.Event()
    babbler = can.Bus(channel, interface="virtual", ignore_config=True)

    def babble() -> None:
        while not stop.is_set():
            babbler.send(can.Message(arbitration_id=0x123, is_extended_id=False))

    thread = threading.Thread(target=babble)
    thread.start()
    try:
        assert asked(bus, 40, 41) == [None, None]
    finally:
        stop.set()
        thread.join()
        babbler.shutdown()


def test_the_time_begins_when_the_request_is_on_its_way(bus: CanBus, driver: Preempted) -> None:
    driver.send_s = 0.1
    assert asked(bus, 4) != [None]


@needs_signals
@pytest.mark.parametrize("nodes", [(4,), NODES])
def test_a_machine_that_stood_still_is_no_silent_node(channel: str, nodes: tuple[int, ...]) -> None:
    """The node is of this machine, too, or what carries its frames is: neither went on, and a write is never repeated.

    A program of its own stops this process, between a request and its answer, for longer than an answer may take.
    """
    script = f"read go; kill -STOP {os.getpid()}; sleep 1.2; kill -CONT {os.getpid()}"
    with subprocess.Popen(["sh", "-c", script], stdin=subprocess.PIPE, text=True) as stopper:

        def answers(request: bytes) -> list[bytes]:
            assert stopper.stdin is not None
            if not stopper.stdin.closed:
                before_s = monotonic()
                stopper.stdin.write("go\n")
                stopper.stdin.close()
                while (now_s := monotonic()) - before_s < 0.2:
                    before_s = now_s
                    sleep(0.001)
                sleep(0.05)
            return well_behaved(request)

        bus = CanBus(can.Bus(channel, interface="virtual", ignore_config=True), "virtual", timeout_s=0.6, bitrate=10**6)
        server = Server(channel, answers)
        bus.receive(0)
        bus.sleep(HEARD_S)
        faults = bus.side_by_side([partial(bus.sdo(node).download, 0x1017, 0, b"\x01\x00") for node in nodes])
        bus.close()
        server.stop()
    assert faults == []
    assert len(server.requests) == len(nodes)


class Chattering(VirtualBus):
    """A driver that has a frame whenever it is asked, as on a bus that says more than this machine can read."""

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return can.Message(arbitration_id=0x123, is_extended_id=False), False


def test_listening_for_a_while_ends_on_a_bus_that_is_never_quiet(channel: str) -> None:
    """What is there when the time is over is read once."""
    bus = CanBus(Chattering(channel), "virtual")
    assert len(list(islice(bus.receive(0.0), 2 * BACKLOG))) == BACKLOG
    bus.close()
