"""Simulated nodes on a real (virtual) bus, met by canopen's stock client and by bare frames."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import can
import canopen
import pytest

from tests.process import PATIENCE_S
from tests.served_nodes import ServedNodes
from tests.simulator.bench import booted


def virtual(channel: str) -> can.BusABC:
    return can.Bus(channel, interface="virtual", ignore_config=True)


class Bench:
    """A bus of our own with generic nodes 1 and 2 on it, not started yet."""

    def __init__(self, channel: str) -> None:
        self.ours, self.theirs = virtual(channel), virtual(channel)
        self.network = ServedNodes(self.theirs, [booted("generic", 1), booted("generic", 2)])

    def send(self, can_id: int, data: str = "") -> None:
        self.ours.send(can.Message(arbitration_id=can_id, data=bytes.fromhex(data), is_extended_id=False))

    def hear(self, can_id: int, seconds: float = PATIENCE_S) -> str | None:
        """The data of the next frame with *can_id*, None where none comes in time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.ours.recv(left)
            if message is not None and message.arbitration_id == can_id:
                return bytes(message.data).hex()
        return None

    def write(self, node_id: int, request: str) -> str | None:
        self.send(0x600 + node_id, request)
        return self.hear(0x580 + node_id)


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    bench = Bench(request.node.name)
    yield bench
    bench.network.stop()
    bench.theirs.shutdown()
    bench.ours.shutdown()


def test_boot_ups_are_on_the_bus_when_start_returns(bench: Bench) -> None:
    bench.network.start()
    first = [bench.ours.recv(0.5), bench.ours.recv(0.5)]
    heard = {(message.arbitration_id, bytes(message.data)) for message in first if message}
    assert (0x701, b"\0") in heard
    assert bench.hear(0x702) is not None


def test_sdo_nmt_and_sync_over_frames(bench: Bench) -> None:
    bench.network.start()
    assert bench.write(1, "4000180100000000") == "4300180181010040"
    assert bench.write(1, "2f00180201000000") == "6000180200000000"
    bench.send(0x080)
    bench.send(0x000, "0101")
    bench.send(0x080)
    assert bench.hear(0x181) == "5002"
    assert bench.hear(0x701) is not None
    bench.send(0x000, "0200")
    bench.send(0x601, "4000180100000000")
    assert bench.hear(0x581, 0.2) is None


def test_reset_boots_up_again(bench: Bench) -> None:
    bench.network.start()
    assert bench.hear(0x702) == "00"
    bench.send(0x000, "8102")
    assert "00" in (bench.hear(0x702) for _ in range(1000)), "heartbeats of before may come first"


def test_heartbeats_keep_their_period(bench: Bench) -> None:
    bench.network.start()
    assert bench.hear(0x701) == "00"
    began = time.monotonic()
    bench.write(1, "2b17100032000000")
    for _ in range(6):
        assert bench.hear(0x701) == "7f"
    assert time.monotonic() - began >= 0.2, "a heartbeat every 50 ms"


def test_nodes_hear_each_other(bench: Bench) -> None:
    """Node 2's RPDO1 follows node 1's TPDO1; both map 16 bits."""
    bench.network.start()
    assert bench.write(1, "2f00180201000000") is not None
    for request in ("2300140102020080", "2300140181010000"):
        assert bench.write(2, request) is not None
    bench.send(0x000, "0100")
    bench.send(0x080)
    assert bench.hear(0x181) == "5002"
    with bench.network.lock:
        assert bench.network.nodes[1].device.value(0x6040) == b"\x50\x02"


def test_stop_leaves_no_thread_and_may_be_called_twice(bench: Bench) -> None:
    before = set(threading.enumerate())
    bench.network.start()
    bench.network.stop()
    bench.network.stop()
    assert set(threading.enumerate()) <= before


def test_every_request_is_answered(bench: Bench) -> None:
    bench.network.start()
    for _ in range(200):
        assert bench.write(1, "4000180100000000") is not None


def test_a_bus_that_dies_ends_the_thread(bench: Bench) -> None:
    bench.network.start()
    bench.theirs.shutdown()
    end = time.monotonic() + PATIENCE_S
    while bench.network.error is None and time.monotonic() < end:
        time.sleep(0.01)
    assert isinstance(bench.network.error, can.CanError)


@pytest.fixture
def node(bench: Bench) -> Iterator[canopen.RemoteNode]:
    bench.network.start()
    network = canopen.Network(bench.ours)
    network.NOTIFIER_CYCLE = 0.05
    network.connect()
    node = network.add_node(canopen.RemoteNode(1, canopen.ObjectDictionary()))
    node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
    yield node
    network.notifier.stop(PATIENCE_S)


def test_stock_client_reads_and_writes(node: canopen.RemoteNode) -> None:
    assert node.sdo.upload(0x1800, 1) == bytes.fromhex("81010040")
    assert node.sdo.upload(0x1008, 0) == b"Generic drive"
    node.sdo.download(0x2002, 0, b"a text of some length")
    assert node.sdo.upload(0x2002, 0) == b"a text of some length"


@pytest.mark.parametrize(
    ("index", "sub_index", "data", "code"),
    [
        (0x5FFF, 0, b"\0", 0x06020000),
        (0x1A00, 0, b"\0", 0x06010000),
        (0x1A02, 0, b"\0\0\0\0", 0x06070012),
        (0x1010, 1, b"evas", 0x08000020),
    ],
)
def test_stock_client_sees_the_abort_codes(
    node: canopen.RemoteNode, index: int, sub_index: int, data: bytes, code: int
) -> None:
    with pytest.raises(canopen.SdoAbortedError) as caught:
        node.sdo.download(index, sub_index, data)
    assert caught.value.code == code


def test_stock_client_remaps_a_pdo(node: canopen.RemoteNode, bench: Bench) -> None:
    for index, sub_index, value, size in (
        (0x1800, 1, 0xC0000181, 4),
        (0x1800, 2, 1, 1),
        (0x1A00, 0, 0, 1),
        (0x1A00, 1, 0x64010110, 4),
        (0x1A00, 0, 1, 1),
        (0x1800, 1, 0x40000181, 4),
    ):
        node.sdo.download(index, sub_index, value.to_bytes(size, "little"))
    received: list[bytes] = []
    heard = threading.Event()

    def listen(_: int, data: bytearray, __: float) -> None:
        received.append(bytes(data))
        heard.set()

    node.network.subscribe(0x181, listen)
    node.nmt.state = "OPERATIONAL"
    node.network.sync.transmit()
    assert heard.wait(PATIENCE_S)
    assert received == [b"\x00\x0a"]


def test_nodes_that_answer_each_other_for_ever_keep_nobody_out(bench: Bench) -> None:
    """Each takes the other's TPDO for a SYNC, and answers it with its own."""
    for node in bench.network.nodes:
        node.device.download(0x1800, 1, (0xC000_0180 + node.device.node_id).to_bytes(4, "little"))
        node.device.download(0x1800, 2, b"\x01")
        node.device.download(0x1800, 1, (0x4000_0080).to_bytes(4, "little"))
    bench.network.start()
    bench.send(0x000, "0100")
    bench.send(0x080)
    for _ in range(1000):
        assert bench.hear(0x080) is not None
    assert bench.write(1, "4000100000000000") is not None
    bench.network.stop()
