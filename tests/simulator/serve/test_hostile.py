"""Clients that mean no good, or have no luck, on a real `dvtcli sim`: the others never notice."""

from __future__ import annotations

import random
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import can
import pytest

from tests.harness.sample import heavy
from tests.process import dvtcli
from tests.simulator.serve.served import PATIENCE_S, Served, own_environment, raw_client, received, served, wait_for

QUESTION = can.Message(arbitration_id=0x601, data=bytes.fromhex("4018100100000000"), is_extended_id=False)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, "generic@1") as server:
        yield server


def answered(bus: can.BusABC) -> bool:
    """Whether node 1 answers an SDO upload on *bus*."""
    bus.send(QUESTION)
    until_answer: list[can.Message] = []
    while not until_answer or until_answer[-1].arbitration_id != 0x581:
        until_answer += received(bus, 1)
    return bytes(until_answer[-1].data[:4]) == bytes.fromhex("43181001")


def knock(port: int) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", port))
    client.settimeout(PATIENCE_S)
    return client


def test_who_says_nothing_or_half_of_it_is_waited_for(server: Served) -> None:
    with server.attach() as good, ExitStack() as stack:
        beginnings = (b"", b"<", b"< op", b"< open can0", b"< open can0 >< send 123 2 1", b"\0\0\0", b"\n" * 5000)
        clients = [stack.enter_context(knock(server.port)) for _ in beginnings]
        for client, beginning in zip(clients, beginnings, strict=True):
            assert client.recv(16) == b"< hi >"
            client.sendall(beginning)
        assert answered(good)
        clients[4].sendall(b" F1 >")
        assert received(good, 1)[0].data.hex() == "01f1"
        assert answered(good)


@pytest.mark.parametrize(
    "rubbish",
    [
        b"<" + b"a" * 3_000_000,
        b"< send 123 8 " + b"0" * 3_000_000,
        b"a" * 3_000_000,
        b"\xff\x00<>" * 700_000,
        b"< open can0 >" + b"<>" * 100_000 + b"!",
    ],
    ids=["line", "frame", "no-bracket", "bytes", "empty"],
)
def test_who_sends_rubbish_by_the_megabyte_is_dropped(server: Served, rubbish: bytes) -> None:
    with server.attach() as good:
        with knock(server.port) as bad, suppress(ConnectionError):
            bad.sendall(rubbish)
            while bad.recv(65536):
                pass
        assert answered(good)


def ask_for_ever(client: socket.socket) -> None:
    while True:
        client.sendall(b"< echo >" * 10_000)


def test_who_asks_and_never_reads_the_answers_is_dropped(server: Served) -> None:
    with knock(server.port) as bad, server.attach() as good:
        bad.sendall(b"< open can0 >")
        with pytest.raises(ConnectionError):
            ask_for_ever(bad)
        assert answered(good)
    server.end()
    assert "took nothing for 5 s while frames waited for it" in server.complaints


def test_clients_come_and_go_while_a_node_is_configured(server: Served) -> None:
    stopping = threading.Event()

    def come_and_go(seed: int) -> None:
        chance = random.Random(seed)
        while not stopping.is_set():
            with suppress(ConnectionError), knock(server.port) as client:
                client.sendall(b"< open can0 >< rawmode >"[: chance.randrange(25)])
                if chance.random() < 0.5:
                    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    threads = [threading.Thread(target=come_and_go, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    try:
        for number in (1, 2, 3):
            ran = server.dvtcli("-n", "1", "map", "tpdo1", "6041", "606C", "--sync", str(number))
            assert ran.returncode == 0, ran.stderr
    finally:
        stopping.set()
        for thread in threads:
            thread.join()


@heavy
@pytest.mark.skipif(sys.platform == "win32", reason="ulimit of POSIX")
def test_a_system_without_room_for_a_client_lets_the_next_one_in(tmp_path: Path) -> None:
    ready, complaints = tmp_path / "ready", tmp_path / "complaints"
    words = f"'{sys.executable}' -m dvtcli sim generic@1 --listen 127.0.0.1:0 --ready-file '{ready}'"
    process = subprocess.Popen(
        ["/bin/sh", "-c", f"ulimit -n 24; exec {words} 2>'{complaints}'"], stdout=subprocess.DEVNULL,
        env=own_environment(tmp_path),
    )  # fmt: skip
    try:
        wait_for(lambda: ready.exists() or process.poll() is not None, "the nodes")
        port = int(ready.read_text("utf-8").rpartition(":")[2])
        said = "cannot take another client: Too many open files"
        with ExitStack() as stack:
            first, *_ = [stack.enter_context(knock(port)) for _ in range(30)]
            wait_for(lambda: said in complaints.read_text("utf-8"), "the complaint")
            assert first.recv(16) == b"< hi >"
            first.sendall(b"< open can0 >")
            assert first.recv(16) == b"< ok >"
        with raw_client(port) as late:
            late.sendall(b"< send 601 8 40 18 10 01 0 0 0 0 >")
            assert late.recv(256).startswith(b"< frame 581 ")
        assert complaints.read_text("utf-8").count(said) == 1
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def test_a_ready_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    ran = dvtcli("sim", "generic", "--listen", "0", "--ready-file", str(tmp_path / "no" / "ready"))
    assert (ran.returncode, ran.stdout) == (2, "")
    assert "ready: No such file or directory" in ran.stderr


GREEDY = """
import socket, sys
held = []
for _ in range(64):
    client = socket.create_connection(("127.0.0.1", {port}))
    client.recv(16)
    client.sendall(b"< open can0 >")
    client.recv(16)
    client.sendall(b"< rawmode >")
    held.append(client)
print("all", flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells whose a connection is")
def test_a_program_that_takes_all_places_keeps_nobody_out(server: Served) -> None:
    """64 connections that all opened a bus: whoever comes gets one of them, as long as it has fewer."""
    words = [sys.executable, "-c", GREEDY.format(port=server.port)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8") as greedy:
        assert greedy.stdout is not None
        assert greedy.stdout.readline() == "all\n"
        for _ in range(3):
            with server.attach() as bus:
                assert answered(bus)
        read = server.dvtcli("-n", "1", "read", "1000")
        assert read.returncode == 0, read.stderr
        greedy.communicate("")
    server.end()
    assert f"process {greedy.pid} has 64 of 64 places, and another program wants one" in server.complaints
