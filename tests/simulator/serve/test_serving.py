"""Addresses, latency and remote frames of `sim`."""

from __future__ import annotations

import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from dvtcli.bus.opening import open_bus
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.sim_state import Kept, read_state, write_state
from dvtcli.operations.session.serve import address, is_loopback
from tests.process import PATIENCE_S, dvtcli, start
from tests.simulator.serve.served import ANSWER_S, Served, own_environment, raw_client, served, wait_for


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("127.0.0.1:29536", "127.0.0.1", 29536),
        ("localhost:0", "localhost", 0),
        (":29537", "127.0.0.1", 29537),
        ("29538", "127.0.0.1", 29538),
        ("[::1]:1", "::1", 1),
    ],
)
def test_where_to_listen(text: str, host: str, port: int) -> None:
    assert address(text) == (host, port)
    assert is_loopback(host)


@pytest.mark.parametrize("text", ["", "host", "host:", "1.2.3.4:99999", "::1:5", "a b:1", "127.0.0.1:-1", "٣"])
def test_where_nobody_can_listen(text: str) -> None:
    with pytest.raises(UsageError, match="HOST:PORT"):
        address(text)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "example.org"])  # noqa: S104 - that is the point
def test_who_is_reached_by_others(host: str) -> None:
    assert not is_loopback(host)


def test_what_is_kept_is_read_again_and_a_draft_never(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "a@1.json"
    assert read_state(path) == Kept()
    values = {(0x1800, 1): b"\x81\x01\x00\x00", (0x1008, 0): b"", (0xFFFF, 0xFF): b"\x00"}
    write_state(path, 7, values)
    assert read_state(path) == Kept(7, values)
    assert [one.name for one in path.parent.iterdir()] == ["a@1.json"]


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{}", "nonsense", '{"schema":"dvtcli.sim-state/1"}', '{"schema":"other/1","values":{}}',
        '{"schema":"dvtcli.sim-state/1","values":{"1800:01":5}}', '{"schema":"dvtcli.sim-state/1","values":{"x":"00"}}',
        '{"schema":"dvtcli.sim-state/1","values":{},"node":0}', '{"schema":"dvtcli.sim-state/1","values":{},"node":[]}',
        '{"schema":"dvtcli.sim-state/1","values":{"10000:01":"00"}}', '{"schema":"dvtcli.sim-state/1","values":[]}',
        "[" * 100_000,
    ],
)  # fmt: skip
def test_what_is_no_state(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a@1.json"
    path.write_text(text)
    with pytest.raises(InputFileError):
        read_state(path)


def uploads_a_second(server: Served, count: int) -> float:
    bus = open_bus("socketcand", "can0", None, {"host": "127.0.0.1", "port": server.port}, timeout_s=float(ANSWER_S))
    sdo = bus.sdo(1)
    sdo.upload(0x1018, 1)
    began = time.perf_counter()
    for _ in range(count):
        sdo.upload(0x1018, 1)
    rate = count / (time.perf_counter() - began)
    bus.close()
    return rate


def test_a_server_takes_its_time_to_answer(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", "--latency", "5") as server:
        assert uploads_a_second(server, 40) <= 200


def test_each_server_takes_its_own_time(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", "generic@2", "--latency", "2:20") as server:
        bus = open_bus(
            "socketcand", "can0", None, {"host": "127.0.0.1", "port": server.port}, timeout_s=float(ANSWER_S)
        )
        took_s: tuple[list[float], list[float]] = [], []
        for sdo, times_s in zip((bus.sdo(1), bus.sdo(2)), took_s, strict=True):
            for _ in range(10):
                began_s = time.perf_counter()
                sdo.upload(0x1018, 1)
                times_s.append(time.perf_counter() - began_s)
        bus.close()
        fast_s, slow_s = map(min, took_s)  # on a busy machine, too, one of ten answers is at once
        assert slow_s >= 0.02
        assert fast_s < slow_s


@pytest.mark.parametrize(
    "words", [("2:20",), ("20", "30"), ("1:20", "1:20"), ("x:20",), ("200:1",), ("1:",), ("1:-5",), ("60001",)]
)
def test_wrong_latencies(words: tuple[str, ...]) -> None:
    ran = dvtcli("sim", "generic@1", *[word for each in words for word in ("--latency", each)])
    assert (ran.returncode, ran.stdout) == (2, "")


def test_a_negative_latency_is_named_as_it_was_typed() -> None:
    ran = dvtcli("sim", "generic@1", "--latency", "-5")
    assert (ran.returncode, "--latency -5: not" in ran.stderr) == (2, True)


def test_no_bit_rate_is_exceeded(tmp_path: Path) -> None:
    """An upload of 4 bytes and its answer are 2 x 111 bits at least: 450 a second at 100 kbit/s."""
    with served(tmp_path, "generic@1", "-b", "100000") as server:
        assert uploads_a_second(server, 100) <= 450


def test_a_remote_frame_brings_a_tpdo(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1") as server, raw_client(server.port) as client:
        client.sendall(b"< send 000 2 01 01 >< sendrtr 181 2 >")
        text = b""
        while b"< frame 181 " not in text:
            data = client.recv(4096)
            assert data
            text += data


def test_what_stands_in_its_help() -> None:
    said = dvtcli("sim", "--help").stdout
    for word in ("--listen HOST:PORT", "--state DIR", "--latency [NODE:]MS", "--ready-file FILE", "sim gen4@1"):
        assert word in said


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells where a process listens")
@pytest.mark.parametrize("words", [("sim", "generic@1"), ("--sim", "generic@1", "gateway")])
def test_without_an_address_only_this_machine_reaches_the_nodes(tmp_path: Path, words: tuple[str, ...]) -> None:
    process = start([*words, "--listen", "0"], env=own_environment(tmp_path))
    try:
        found: list[str] = []
        wait_for(lambda: found.extend(_listening(process.pid)) or found or process.poll() is not None, "a listener")
        assert set(found) == {"0100007F"}, "127.0.0.1, as Linux writes it"
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE_S)


def _listening(pid: int) -> list[str]:
    """The addresses at which process *pid* listens by TCP."""
    held = set()
    for one in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # it was closed meanwhile
            held.add(str(one.readlink()))
    rows = [
        row.split()
        for name in ("tcp", "tcp6")
        for row in Path(f"/proc/{pid}/net/{name}").read_text("ascii").splitlines()[1:]
    ]
    return [row[1].partition(":")[0] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in held]
