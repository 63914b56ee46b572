"""SDO block transfers: canopen's own client in both directions, lost segments, and what clients get wrong."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Iterator

import can
import canopen
import pytest
from can.interfaces.virtual import VirtualBus

from dvtcli.simulator.device.sdo_server import SdoServer
from tests.harness.sample import heavy
from tests.process import PATIENCE_S
from tests.served_nodes import ServedNodes
from tests.simulator.bench import Client, booted

SIZES = (0, 1, 4, 6, 7, 8, 13, 14, 888, 889, 890, 1778, 1779, 5000, 100_000)
TEXT = 0x2002


def pattern(size: int) -> bytes:
    return bytes(count * 7 % 251 for count in range(size))


class LossyBus(VirtualBus):
    """A virtual bus that loses the frames of *lost*: the n-th that is sent on it, from 0."""

    lost: frozenset[int] = frozenset()
    count = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        number, self.count = self.count, self.count + 1
        if number not in self.lost:
            super().send(msg, timeout)


class Line:
    """canopen's client and a simulated node, each at a lossy end of one bus."""

    def __init__(self, channel: str) -> None:
        self.ours, self.theirs = LossyBus(channel), LossyBus(channel)
        self.device = booted()
        self.device.set_value(0x1017, 0, bytes(2))
        self.simulated = ServedNodes(self.theirs, [self.device])
        self.simulated.start()
        self.network = canopen.Network(self.ours)
        self.network.NOTIFIER_CYCLE = 0.02
        self.network.connect()
        self.sdo = self.network.add_node(canopen.RemoteNode(1, canopen.ObjectDictionary())).sdo
        self.sdo.RESPONSE_TIMEOUT = PATIENCE_S

    def close(self) -> None:
        self.network.notifier.stop(PATIENCE_S)
        self.simulated.stop()
        self.theirs.shutdown()
        self.ours.shutdown()

    def download(self, data: bytes, *, crc: bool = True) -> None:
        size = len(data) or None
        with self.sdo.open(TEXT, 0, "wb", size=size, block_transfer=True, request_crc_support=crc) as stream:
            stream.write(data)

    def upload(self, *, crc: bool = True) -> bytes:
        with self.sdo.open(TEXT, 0, "rb", block_transfer=True, request_crc_support=crc) as stream:
            return bytes(stream.read())


@pytest.fixture
def line(request: pytest.FixtureRequest) -> Iterator[Line]:
    line = Line(request.node.name)
    yield line
    line.close()


@heavy
@pytest.mark.parametrize("crc", [True, False])
def test_stock_client_both_ways(line: Line, crc: bool) -> None:
    for size in SIZES:
        if size:  # the stock client cannot send an empty block
            line.download(pattern(size), crc=crc)
            assert line.device.value(TEXT) == pattern(size), size
        else:
            line.device.set_value(TEXT, 0, b"")
        assert line.upload(crc=crc) == pattern(size), size


@pytest.mark.parametrize("lost", [{1}, {2}, {60}, {126}, {5, 6, 7}], ids=str)
def test_segments_lost_on_the_way_to_the_node_are_sent_again(line: Line, lost: set[int]) -> None:
    line.ours.count, line.ours.lost = 0, frozenset(lost)
    line.download(pattern(3000))
    assert line.device.value(TEXT) == pattern(3000)


@pytest.mark.parametrize("lost", [{1}, {2}, {60}, {126}, {5, 6, 7}], ids=str)
def test_segments_lost_on_the_way_from_the_node_are_sent_again(line: Line, lost: set[int]) -> None:
    line.device.set_value(TEXT, 0, pattern(3000))
    line.theirs.count, line.theirs.lost = 0, frozenset(lost)
    assert line.upload() == pattern(3000)


def asked(server: SdoServer, request: str) -> list[str]:
    """All responses in hex to a request in hex."""
    response = server.handle(bytes.fromhex(request).ljust(8, b"\0"))
    return [each.hex() for each in ([] if response is None else [response]) + server.take_more()]


def test_upload_by_the_byte() -> None:
    device = booted()
    device.set_value(TEXT, 0, b"123456789")
    server = SdoServer(device)
    assert asked(server, "a402200002") == ["c602200009000000"]
    assert asked(server, "a3") == ["0131323334353637", "8238390000000000"]
    assert asked(server, "a20002") == ["0131323334353637", "8238390000000000"]  # both were lost
    assert asked(server, "a20101") == ["8138390000000000"]
    assert asked(server, "a20101") == ["d5c3310000000000"]  # 5 bytes unused, CRC 0x31C3 (CiA 301, 7.2.4.3.16)
    assert asked(server, "a1") == []
    assert asked(server, "4000180100000000") == ["4300180181010040"]


def test_download_by_the_byte() -> None:
    device = booted()
    server = SdoServer(device)
    assert asked(server, "c602200009000000") == ["a40220007f000000"]
    assert asked(server, "0131323334353637") == []
    assert asked(server, "8339390000000000") == ["a2017f0000000000"]  # the second was lost
    assert asked(server, "8138390000000000") == ["a2017f0000000000"]
    assert asked(server, "d5c331") == ["a100000000000000"]
    assert device.value(TEXT) == b"123456789"


def test_an_empty_download() -> None:
    device = booted()
    server = SdoServer(device)
    asked(server, "c602200000000000")
    assert asked(server, "81") == ["a2017f0000000000"]
    assert asked(server, "dd0000") == ["a100000000000000"]
    assert device.value(TEXT) == b""


@pytest.mark.parametrize(
    ("requests", "code"),
    [
        (["a402200000"], 0x05040002),
        (["a402200080"], 0x05040002),
        (["a402200002", "a3", "a20302"], 0x05040003),
        (["a402200002", "a20002"], 0x05040001),
        (["a402200002", "a3", "a20100"], 0x05040002),
        (["a4ff5f0002"], 0x06020000),
        (["a404200002"], 0x06010001),
        (["a3"], 0x05040001),
        (["c6ff5f0001"], 0x06020000),
        (["c600100004"], 0x06010002),
        (["c603200003"], 0x06070012),
        (["c6022000ffffff7f"], 0x05040005),
        (["c602200002", "8141420000000000", "d50000"], 0x05040004),
        (["c602200003", "8141420000000000", "d5" + crc_hqx(b"AB", 0).to_bytes(2, "little").hex()], 0x06070013),
        (["c602200001", "8141420000000000", "d5" + crc_hqx(b"AB", 0).to_bytes(2, "little").hex()], 0x06070012),
        (["c1"], 0x05040001),
    ],
)
def test_aborts(requests: list[str], code: int) -> None:
    server = SdoServer(booted())
    *before, last = requests
    for request in before:
        assert all(not response.startswith("80") for response in asked(server, request))
    (answer,) = asked(server, last)
    assert answer[:2] == "80"
    assert answer[8:] == code.to_bytes(4, "little").hex()
    assert asked(server, "4000180100000000") == ["4300180181010040"]


def test_a_short_object_comes_without_blocks_where_the_client_allows_it() -> None:
    assert asked(SdoServer(booted()), "a40018010708") == ["4300180181010040"]


@pytest.mark.parametrize("begin", [["a402200002"], ["a402200002", "a3"], ["c602200009"], ["c602200009", "01"]])
def test_a_client_s_abort_ends_a_block_transfer(begin: list[str]) -> None:
    server = SdoServer(booted())
    for request in begin:
        asked(server, request)
    assert asked(server, "8002200000000405") == []
    assert asked(server, "4000180100000000") == ["4300180181010040"]


def test_a_new_request_ends_a_block_upload() -> None:
    server = SdoServer(booted())
    asked(server, "a402200002")
    asked(server, "a3")
    assert asked(server, "4000180100000000") == ["4300180181010040"]
    assert asked(server, "a20102") == ["8001020001000405"]


def test_the_device_refuses_a_block_like_any_download() -> None:
    client = Client.on(booted())
    assert asked(client.server, "c6001a0001000000") == ["a4001a007f000000"]
    asked(client.server, "8100")
    assert asked(client.server, "d90000") == ["80001a0000000106"]
