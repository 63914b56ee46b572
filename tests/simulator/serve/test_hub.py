"""Clients that share the simulated nodes' bus: good ones, slow ones, and others."""

from __future__ import annotations

import os
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import can
import pytest

from dvtcli.domain.ports import Frame
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from dvtcli.simulator.network.hub import MOST_CLIENTS, MOST_KEPT, Hub
from dvtcli.simulator.network.hub_client import LOOK_S, Client
from dvtcli.simulator.network.shared_bus import Server, Wire
from dvtcli.simulator.network.station import stations
from tests.harness.sample import heavy
from tests.simulator.serve.served import PATIENCE_S, raw_client, received, wait_for

STALL_S = 1.5


@dataclass
class Bench:
    """A server in a thread of this process; `said` is what it says about clients."""

    server: Server
    port: int
    said: list[str] = field(default_factory=list)

    def attach(self) -> can.BusABC:
        return can.Bus(interface="socketcand", host="127.0.0.1", port=self.port, channel="can0", ignore_config=True)


def generic() -> StrictDevice:
    """A node without a heartbeat: what is heard is what the tests send."""
    device = StrictDevice(read_eds(family_eds("generic")).dictionary, load_family("generic"), 1)
    device.set_value(0x1017, 0, bytes(2))
    return device


@pytest.fixture
def bench() -> Iterator[Bench]:
    said: list[str] = []
    hub = Hub([("127.0.0.1", 0)], said.append, STALL_S)
    server = Server(stations([generic()]), hub, Wire())
    thread = threading.Thread(target=server.run)
    thread.start()
    assert hub.port is not None
    yield Bench(server, hub.port, said)
    server.stop()
    thread.join()
    hub.close()


def lines(client: socket.socket, wanted: int) -> list[bytes]:
    """The next *wanted* elements that *client* is told."""
    text = b""
    while text.count(b">") < wanted:
        data = client.recv(65536)
        assert data, text
        text += data
    return [part.lstrip() + b">" for part in text.split(b">")[:wanted]]


def test_frames_of_one_reach_the_others_and_the_nodes_and_not_itself(bench: Bench) -> None:
    with bench.attach() as one, bench.attach() as other:
        one.send(can.Message(arbitration_id=0x601, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
        (answer,) = received(one, 1)
        assert (answer.arbitration_id, answer.data[:4].hex()) == (0x581, "43001000")
        assert [frame.arbitration_id for frame in received(other, 2)] == [0x601, 0x581]
        other.send(can.Message(arbitration_id=0x12345678, data=b"\x01\xf1", is_extended_id=True))
        (frame,) = received(one, 1)
        assert (frame.arbitration_id, bytes(frame.data), frame.is_extended_id) == (0x12345678, b"\x01\xf1", True)
        assert abs(frame.timestamp - time.time()) < 60
        assert other.recv(0.05) is None


def test_requests_may_come_in_pieces_or_all_at_once(bench: Bench) -> None:
    with socket.create_connection(("127.0.0.1", bench.port)) as client, bench.attach() as other:
        client.settimeout(PATIENCE_S)
        client.sendall(b"< open vcan7 >< rawmode >< echo >< send 123 2 1 F1 >")
        assert lines(client, 4) == [b"< hi >", b"< ok >", b"< ok >", b"< echo >"]
        for byte in b"\n< send 0000ABCD 1 ff >":
            client.sendall(bytes([byte]))
        frames = received(other, 2)
        assert [(frame.arbitration_id, frame.data.hex(), frame.is_extended_id) for frame in frames] == [
            (0x123, "01f1", False),
            (0xABCD, "ff", True),
        ]


@heavy
def test_no_frame_comes_with_the_answer_to_rawmode(bench: Bench) -> None:
    with bench.attach() as busy:
        stopping = threading.Event()

        def chatter() -> None:
            while not stopping.is_set():
                busy.send(can.Message(arbitration_id=0x123, is_extended_id=False))
                time.sleep(0.0002)

        thread = threading.Thread(target=chatter)
        thread.start()
        try:
            for _ in range(10):
                with bench.attach() as late:
                    assert len(received(late, 3)) == 3
        finally:
            stopping.set()
            thread.join()


@pytest.mark.skipif(not hasattr(socket, "TCP_QUICKACK"), reason="this system acknowledges when it likes")
def test_frames_sent_one_after_the_other_do_not_wait_for_an_acknowledgement(bench: Bench) -> None:
    """A client without TCP_NODELAY, as python-can's is, else sends its second frame some 40 ms after the first."""
    gaps = []
    with bench.attach() as one, bench.attach() as other:
        for _ in range(21):
            one.send(can.Message(arbitration_id=0x123, is_extended_id=False))
            one.send(can.Message(arbitration_id=0x601, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
            first, second, _ = received(other, 3)
            gaps.append(second.timestamp - first.timestamp)
            assert len(received(one, 1)) == 1
    assert median(gaps) < 0.02


def test_remote_frames_can_be_asked_for(bench: Bench) -> None:
    with raw_client(bench.port) as one, raw_client(bench.port) as other:
        one.sendall(b"< sendrtr 181 2 >")
        (line,) = lines(other, 1)
        assert line.startswith(b"< rtr 181 ")
        assert line.endswith(b" 2 >")


def test_outside_of_raw_mode_frames_may_be_sent_and_none_come(bench: Bench) -> None:
    with raw_client(bench.port) as one, raw_client(bench.port) as other:
        one.sendall(b"< bcmmode >")
        assert lines(one, 1) == [b"< ok >"]
        one.sendall(b"< send 123 0 >")
        assert lines(other, 1)[0].startswith(b"< frame 123 ")
        other.sendall(b"< send 124 0 >< echo >")
        assert lines(other, 1) == [b"< echo >"]
        one.sendall(b"< echo >")
        assert lines(one, 1) == [b"< echo >"]


def test_a_wrong_request_is_refused_and_the_next_one_taken(bench: Bench) -> None:
    with raw_client(bench.port) as client:
        client.sendall(b"< send 123 2 11 >< subscribe 0 0 123 >< echo >")
        assert lines(client, 3) == [b"< error syntax >", b"< error unknown command >", b"< echo >"]
    assert len(bench.said) == 1
    assert "length and data differ" in bench.said[0]


def test_rubbish_ends_its_own_connection_only(bench: Bench) -> None:
    with bench.attach() as good:
        for rubbish in (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n< open can0 >", b"\xff" * 5000, b"<" * 2000):
            with socket.create_connection(("127.0.0.1", bench.port)) as bad:
                bad.settimeout(PATIENCE_S)
                assert bad.recv(256) == b"< hi >"
                bad.sendall(rubbish)
                with pytest.raises((ConnectionError, AssertionError)):
                    lines(bad, 1)
        good.send(can.Message(arbitration_id=0x601, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
        assert received(good, 1)[0].arbitration_id == 0x581
    assert len(bench.said) == 3
    assert "GET / HTTP" in bench.said[0]


def test_who_disappears_disturbs_nobody_and_what_it_said_counts(bench: Bench) -> None:
    with bench.attach() as good:
        for _ in range(20):
            gone = raw_client(bench.port)
            gone.sendall(b"< send 123 0 >< send 1")
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            assert received(good, 1)[0].arbitration_id == 0x123
            gone.close()
        with raw_client(bench.port) as polite:
            polite.sendall(b"< send 124 0 >")
        assert received(good, 1)[0].arbitration_id == 0x124
        wait_for(lambda: bench.server.hub.clients == 1, "the others to be gone")
    assert bench.said == []


@heavy
def test_a_stalled_client_is_dropped_and_the_others_lose_nothing(bench: Bench) -> None:
    count = 60_000
    with raw_client(bench.port, receive_buffer=4096) as stalled, bench.attach() as good, bench.attach() as sender:

        def flood() -> None:
            for number in range(count):
                sender.send(can.Message(arbitration_id=0x123, data=number.to_bytes(4, "big"), is_extended_id=False))

        thread = threading.Thread(target=flood)
        thread.start()
        got = received(good, count)
        thread.join()
        assert [int.from_bytes(frame.data, "big") for frame in got] == list(range(count))
        assert len(bench.said) == 1
        assert "took nothing for 1.5 s" in bench.said[0]
        assert bench.server.hub.clients == 2
        del stalled


def test_a_server_that_was_stopped_itself_drops_nobody_for_it() -> None:
    """Nobody looked for an hour: that a client took nothing meanwhile may be the machine's doing."""
    said: list[str] = []
    with raw_pair(said) as (hub, client, _theirs):
        client.release()
        while not client.blocked:
            assert not client.gone
            hub.tell_all(b"< frame 181 0.0 0102030405060708 >" * 1000, source=None)
            hub.wait(0.0, lambda _client: True)
        back_s = now_s = time.monotonic() + 3600
        client.flush(now_s, STALL_S, MOST_KEPT)
        assert not client.gone
        while not client.gone:
            now_s += LOOK_S
            client.flush(now_s, STALL_S, MOST_KEPT)
    assert client.why == "took nothing for 1.5 s while frames waited for it"
    assert now_s - back_s > STALL_S - 2 * LOOK_S


@heavy
def test_the_bus_waits_for_a_slow_client(bench: Bench) -> None:
    count = 20_000
    with raw_client(bench.port, receive_buffer=4096) as slow, bench.attach() as sender:

        def flood() -> None:
            for number in range(count):
                sender.send(can.Message(arbitration_id=0x123, data=number.to_bytes(4, "big"), is_extended_id=False))

        thread = threading.Thread(target=flood)
        thread.start()
        text = bytearray()
        while text.count(b">") < count:
            data = slow.recv(16384)
            assert data
            text += data
            time.sleep(0.002)
        thread.join()
        numbers = [int(line.split()[4], 16) for line in bytes(text).split(b">") if line.strip()]
        assert numbers == list(range(count))
    assert bench.said == []


def test_nobody_but_the_sender_waits_for_who_reads_nothing() -> None:
    """One stalls, one floods, and the third one's requests are answered meanwhile, however long that takes."""
    said: list[str] = []
    hub = Hub([("127.0.0.1", 0)], said.append, 3600.0)
    server = Server(stations([generic()]), hub, Wire())
    thread = threading.Thread(target=server.run)
    thread.start()
    assert hub.port is not None
    flooding = threading.Event()
    with raw_client(hub.port, receive_buffer=4096) as stalled, raw_client(hub.port) as asking:
        with raw_client(hub.port) as flooder:

            def flood() -> None:
                with suppress(OSError):
                    while flooder.sendall(b"< send 123 8 1 2 3 4 5 6 7 8 >" * 1000) is None:
                        flooding.set()

            def drain() -> None:
                with suppress(OSError):
                    while flooder.recv(65536):
                        pass

            threads = [threading.Thread(target=each) for each in (flood, drain)]
            for each in threads:
                each.start()
            wait_for(
                lambda: any(client.queued_by_sender.values() for client in (*hub._clients.values(),)), "somebody behind"
            )
            for _ in range(200):
                asking.sendall(b"< send 601 8 40 00 10 00 00 00 00 00 >")
                text = b""
                while b"< frame 581 " not in text:
                    text = text[-20:] + asking.recv(65536)
            assert (said, hub.clients) == ([], 3)
            flooder.shutdown(socket.SHUT_RDWR)
        for each in threads:
            each.join()
        del stalled
    server.stop()
    thread.join()
    hub.close()


def test_who_is_megabytes_behind_is_dropped() -> None:
    """What the nodes themselves say waits for nobody: one that never reads it is told so at some point."""
    said: list[str] = []
    with raw_pair(said) as (hub, client, theirs):
        while hub.clients:
            hub.tell_all(b"< frame 181 0.0 0102030405060708 >" * 1000, source=None)
            hub.wait(0.0, lambda _client: True)
        assert theirs.fileno() >= 0
    (told,) = said
    assert "it reads too slowly" in told
    assert client.waiting > MOST_KEPT


def test_who_opens_no_bus_makes_room(bench: Bench) -> None:
    """Whoever takes all places and says nothing keeps nobody out."""
    idle = [socket.create_connection(("127.0.0.1", bench.port)) for _ in range(MOST_CLIENTS)]
    for each in idle:
        each.settimeout(PATIENCE_S)
        assert each.recv(16) == b"< hi >"
    with raw_client(bench.port) as one, raw_client(bench.port) as other:
        one.sendall(b"< send 123 0 >")
        assert lines(other, 1)[0].startswith(b"< frame 123 ")
    assert [idle[0].recv(16), idle[1].recv(16)] == [b"", b""]
    for each in idle:
        each.close()
    assert len(bench.said) == 2
    assert "it opened no bus, and 64 are connected" in bench.said[0]


def test_who_has_hung_up_makes_room_before_anybody_who_has_not() -> None:
    """All come before the hub looks: it takes more connections at once than it has places."""
    said: list[str] = []
    hub = Hub([("127.0.0.1", 0)], said.append, 3600.0)
    try:
        with socket.create_connection(("127.0.0.1", hub.port or 0)) as slow:
            slow.settimeout(PATIENCE_S)
            for _ in range(2 * MOST_CLIENTS):
                socket.create_connection(("127.0.0.1", hub.port or 0)).close()
            with socket.create_connection(("127.0.0.1", hub.port or 0)) as asking:
                asking.sendall(b"< open can0 >< rawmode >< send 123 1 F1 >")
                for _ in range(MOST_CLIENTS):
                    socket.create_connection(("127.0.0.1", hub.port or 0)).close()
                frames: list[Frame] = []
                for _ in range(8):
                    frames += [frame for _, frame in hub.wait(0.0, lambda _client: True)]
                slow.sendall(b"< open can0 >")
                hub.wait(PATIENCE_S, lambda _client: True)
                assert lines(slow, 2) == [b"< hi >", b"< ok >"]
                assert [frame.can_id for frame in frames] == [0x123]
    finally:
        hub.close()
    assert said == []


def test_there_is_room_for_many_and_more_are_refused(bench: Bench) -> None:
    clients = [raw_client(bench.port) for _ in range(MOST_CLIENTS)]
    with socket.create_connection(("127.0.0.1", bench.port)) as refused:
        refused.settimeout(PATIENCE_S)
        assert refused.recv(256) == b""
    clients[0].sendall(b"< send 123 0 >")
    for client in clients[1:]:
        assert lines(client, 1)[0].startswith(b"< frame 123 ")
    for client in clients:
        client.close()
    who = (
        f"{MOST_CLIENTS} of them of process {os.getpid()}"
        if Path("/proc/net/tcp").exists()
        else "64 of them of host 127.0.0.1"
    )
    assert bench.said == [f"refused a client: {MOST_CLIENTS} are connected already, {who}"]


@contextmanager
def raw_pair(said: list[str]) -> Iterator[tuple[Hub, Client, socket.socket]]:
    """A hub that nobody serves but the test, with one client in raw mode."""
    hub = Hub([("127.0.0.1", 0)], said.append, 3600.0)
    assert hub.port is not None
    with socket.create_connection(("127.0.0.1", hub.port)) as theirs:
        theirs.sendall(b"< open can0 >< rawmode >")
        while not [client for client in hub._clients.values() if client.raw]:
            hub.wait(0.1, lambda _client: True)
        (client,) = hub._clients.values()
        yield hub, client, theirs
    hub.close()


@dataclass
class Starter:
    """A bus on which somebody starts all nodes and sends one SYNC."""

    frames: list[Frame]

    def tell(self, frame: Frame) -> None:
        """Nobody listens there."""

    def received(self) -> list[Frame]:
        frames, self.frames = self.frames, []
        return frames


@heavy
def test_nodes_that_answer_each_other_for_ever_lose_what_is_too_much() -> None:
    """Each of three takes the others' TPDOs for SYNCs: every frame brings two more."""
    devices = []
    for node_id in (1, 2, 3):
        device = StrictDevice(read_eds(family_eds("generic")).dictionary, load_family("generic"), node_id)
        device.download(0x1800, 1, (0xC000_0180 + node_id).to_bytes(4, "little"))
        device.download(0x1800, 2, b"\x01")
        device.download(0x1800, 1, (0x4000_0080).to_bytes(4, "little"))
        devices.append(device)
    said: list[str] = []
    hub, wire = Hub([], said.append), Wire()
    starter = Starter([Frame(0x000, b"\x01\x00"), Frame(0x080, b"")])
    server = Server(stations(devices), hub, wire, [starter], frames_lost=lambda: said.append("lost"))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    wait_for(lambda: server.frames > 40_000, "frames")
    server.stop()
    thread.join()
    hub.close()
    assert said == ["lost"]
    assert wire.waiting(devices[0]) <= 10_000
