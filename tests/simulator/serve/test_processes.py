"""`dvtcli sim` in one process, other programs in others: a second dvtcli, python-can's tools, canopen."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from statistics import median

import can
import canopen
import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.process import dvtcli, environment
from tests.simulator.serve.served import (
    PATIENCE_S,
    Served,
    own_environment,
    raw_client,
    received,
    served,
    state_folder,
    wait_for,
)

pytestmark = pytest.mark.drawn(8, "processes")

VENDOR = "0x1018:01  Identity object.Vendor-ID = "
#: what pdo_config.dvt puts into the frames, as the simulated controller's values are
FRAMES = {
    0x181: "24faffff78005002",
    0x281: "000388fffe021f",
    0x381: "0000000a80020500",
    0x481: "000000000005",
}


@pytest.fixture
def gen4(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, "gen4@1") as server:
        yield server


def test_a_script_a_store_and_a_logger(gen4: Served, tmp_path: Path) -> None:
    ran = gen4.dvtcli("-n", "1", "run", "scripts/pdo_config.dvt")
    assert ran.returncode == 0, ran.stderr
    assert "TPDO1 set: 8 writes, read back equal" in ran.stdout
    stored = gen4.dvtcli("-n", "1", "--yes", "store", "--prove")
    assert stored.returncode == 0, stored.stderr
    assert "proved: after the reset 10 PDOs read back equal, and the test value was gone" in stored.stdout
    with Logger(gen4.port) as logger:
        started = gen4.dvtcli("-n", "1", "nmt", "start")
        assert started.stdout == "NMT start to node 1: OPERATIONAL\n"
        synced = gen4.dvtcli("-n", "1", "sync", "--count", "3", "--period", "20")
        assert synced.stdout.startswith("3 SYNCs sent, "), "how many frames come by then is the machine's affair"
        assert sorted(logger.tpdos(12)) == sorted(3 * list(FRAMES.items()))
    folder = state_folder(tmp_path)
    assert [path.name for path in (folder / "locks").iterdir()] == [f"socketcand_127.0.0.1_{gen4.port}-1.lock"]
    assert list((folder / "journals").iterdir()) == []


class Logger:
    """Stock `python -m can.logger` on the bus at *port*, printing what it hears."""

    def __init__(self, port: int) -> None:
        bus = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", f"port={port}"]
        self.process = subprocess.Popen(
            [sys.executable, "-u", "-m", "can.logger", *bus],
            stdout=subprocess.PIPE,
            encoding="utf-8",
            env=environment(),
        )

    def __enter__(self) -> Logger:
        while "Can Logger" not in self._line():
            pass
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()  # how it ends is its own affair
        self.process.communicate()

    def tpdos(self, wanted: int) -> list[tuple[int, str]]:
        """The next *wanted* TPDO frames."""
        found: list[tuple[int, str]] = []
        while len(found) < wanted:
            match = re.search(r"ID: +([0-9a-f]+) .* DL: +\d +((?:[0-9a-f]{2} ?)*)", self._line())
            if match is not None and 0x181 <= int(match[1], 16) < 0x580:
                found.append((int(match[1], 16), match[2].replace(" ", "")))
        return found

    def _line(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, "the logger ended"
        return line


def test_two_clients_see_the_same_frames(gen4: Served) -> None:
    assert gen4.dvtcli("-n", "1", "run", "scripts/pdo_config.dvt").returncode == 0
    one, other = gen4.attach(), gen4.attach()
    one.send(can.Message(arbitration_id=0, data=[1, 1], is_extended_id=False))
    one.send(can.Message(arbitration_id=0x080, is_extended_id=False))
    for bus, wanted in ((one, 4), (other, 6)):
        frames = [frame for frame in received_but_heartbeats(bus, wanted) if frame[0] > 0x080]
        assert dict(frames) == FRAMES


def received_but_heartbeats(bus: can.BusABC, wanted: int) -> list[tuple[int, str]]:
    found: list[tuple[int, str]] = []
    while len(found) < wanted:
        (frame,) = received(bus, 1)
        if frame.arbitration_id < 0x700:
            found.append((frame.arbitration_id, bytes(frame.data).hex()))
    return found


def test_a_foreign_client_reads_and_receives(gen4: Served) -> None:
    bus = gen4.attach()
    network = canopen.Network(bus=bus)
    network.notifier = can.Notifier(bus, network.listeners, 1)
    try:
        dictionary = canopen.import_od(str(family_eds("gen4")))
        node = network.add_node(canopen.RemoteNode(1, dictionary))
        node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
        assert node.sdo[0x1018][1].raw == 0x1E
        assert node.sdo[0x1008].raw == "Gen4"
        node.tpdo.read()  # type: ignore[no-untyped-call]
        node.tpdo[1].clear()
        node.tpdo[1].add_variable(0x606C)
        node.tpdo[1].add_variable(0x6041)
        node.tpdo[1].trans_type = 1
        node.tpdo[1].enabled = True
        node.tpdo[1].save()
        node.nmt.state = "OPERATIONAL"
        came: list[object] = []
        node.tpdo[1].add_callback(came.append)  # wait_for_reception misses a frame that is quicker than it
        network.sync.transmit()
        wait_for(lambda: came, "the TPDO")
        assert [variable.raw for variable in node.tpdo[1].map] == [-1500, 0x0250]
    finally:
        network.notifier.stop()


def test_what_was_stored_survives_a_restart(tmp_path: Path) -> None:
    words = ("gen4@1", "tmcm@5", "--state", str(tmp_path / "kept"))
    with served(tmp_path, *words) as first:
        assert first.dvtcli("-n", "1", "map", "tpdo3", "6041", "606C/32", "--sync", "7").returncode == 0
        assert first.dvtcli("-n", "1", "store").returncode == 0
        assert first.dvtcli("-n", "1", "set", "tpdo3", "--sync", "9").returncode == 0
        assert first.dvtcli("-n", "5", "set", "tpdo1", "--timer", "120").returncode == 0
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["gen4@1.json"]
    with served(tmp_path, *words) as second:
        (pdo,) = json.loads(second.dvtcli("-n", "1", "--json", "pdo", "tpdo3").stdout)["pdos"]
        assert (pdo["transmission_type"], pdo["enabled"], pdo["bits"]) == (7, True, 48)
        (pdo,) = json.loads(second.dvtcli("-n", "5", "--json", "pdo", "tpdo1").stdout)["pdos"]
        assert pdo["event_timer_ms"] != 120
        assert second.dvtcli("-n", "1", "restore", "--yes").returncode == 0
    with served(tmp_path, *words) as third:
        (pdo,) = json.loads(third.dvtcli("-n", "1", "--json", "pdo", "tpdo3").stdout)["pdos"]
        assert (pdo["enabled"], pdo["bits"]) == (False, 0)


def test_nodes_that_keep_the_same_node_id_are_told(tmp_path: Path) -> None:
    (tmp_path / "gen4@1.json").write_text('{"schema":"dvtcli.sim-state/1","node":7,"values":{}}')
    ran = dvtcli("sim", "gen4@1", "tmcm@7", "--listen", "0", "--state", str(tmp_path), "--latency", "1:5")
    assert (ran.returncode, ran.stdout) == (2, "")
    assert "2 nodes have node-ID 7" in ran.stderr


def test_a_state_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "gen4@1.json").write_text('{"schema":"dvtcli.sim-state/1","values":{"1800":"01"}}')
    ran = dvtcli("sim", "gen4@1", "--listen", "0", "--state", str(tmp_path))
    assert (ran.returncode, ran.stdout) == (4, "")
    assert "gen4@1.json: not a state file of a simulated node" in ran.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_it_leaves_cleanly(gen4: Served, number: int, code: int) -> None:
    with raw_client(gen4.port) as client:
        assert gen4.end(number) == code
        while client.recv(4096):
            pass
    assert gen4.said == (
        f"listening on 127.0.0.1:{gen4.port}: node 1 gen4; attach with\n"
        f"dvtcli -i socketcand -c 127.0.0.1:{gen4.port}\n"
        "Names of objects: --eds gen4, or `dcf: gen4` in a network file.\n"
    )
    assert gen4.complaints.strip() == ("interrupted" if code == 130 else "terminated")
    assert list(gen4.folder.glob("ready*")) == []


def test_a_slow_node_is_told_in_full_by_scan(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1", "--latency", "300") as server:
        found = server.dvtcli("--timeout", "20", "--json", "scan")
        missed = server.dvtcli("--timeout", "0.1", "scan")
    assert found.returncode == 0, found.stderr
    (row,) = json.loads(found.stdout)["nodes"]
    assert (row["node"], row["vendor_id"], row["note"]) == (1, 0x1E, "")
    assert missed.returncode == 0, missed.stderr
    assert (
        "  node 1 did not answer for 0x1000:00 within 0.1 s\n  scan --wait 500 gives each node more time"
        in missed.stdout
    )


def test_rubbish_is_said_and_disturbs_nobody(gen4: Served) -> None:
    with socket.create_connection(("127.0.0.1", gen4.port)) as bad:
        bad.sendall(b"EHLO localhost\r\n")
        while bad.recv(256):
            pass
    assert gen4.dvtcli("-n", "1", "read", "1018:1").stdout.startswith(f"{VENDOR}30 ")
    gen4.end()
    assert "warning: dropped client 127.0.0.1:" in gen4.complaints
    assert "is not a socketcand request" in gen4.complaints


def test_a_port_that_is_taken(gen4: Served) -> None:
    ran = dvtcli("sim", "gen4", "--listen", f"127.0.0.1:{gen4.port}")
    assert (ran.returncode, ran.stdout) == (5, "")
    assert f"error: cannot listen on 127.0.0.1:{gen4.port}" in ran.stderr
    assert "Address already in use" in ran.stderr


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("nothing",), 2, "nothing: no such family and no such file"),
        (("gen4@1", "tmcm@1"), 2, "node-ID 1 was given twice"),
        (("gen4", "--listen", "here"), 2, "--listen here: not HOST:PORT"),
        (("gen4", "--listen", "127.0.0.1:70000"), 2, "not HOST:PORT"),
        (("gen4", "--fault", "refuse@1"), 2, "--fault: refuse@1"),
        (("gen4", "--sim", "tmcm"), 2, "name nodes to serve after"),
        (("gen4", "-i", "nothing", "-c", "x"), 5, "cannot open nothing:x"),
        ((), 2, "Missing argument"),
    ],
)
def test_what_is_wrong_is_said(words: tuple[str, ...], code: int, said: str) -> None:
    ran = dvtcli("sim", *words)
    assert (ran.returncode, ran.stdout) == (code, "")
    assert said in ran.stderr


def test_a_bus_of_a_settings_file_is_not_joined(tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text('interface = "nothing"\nchannel = "x"\n')
    process = subprocess.Popen(
        [sys.executable, "-m", "dvtcli", "sim", "gen4", "--listen", "127.0.0.1:0", "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", cwd=tmp_path, env=own_environment(tmp_path),
    )  # fmt: skip
    assert process.stdout is not None
    document = json.loads(process.stdout.readline())
    assert (document["host"], document["bus"], document["nodes"]) == ("127.0.0.1", None, [1])
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE_S)


def test_nodes_join_a_bus_of_others(gen4: Served, tmp_path: Path) -> None:
    """The bus that the second `sim` joins is the first one's: it is a client there, and listens besides."""
    words = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs", f"port={gen4.port}"]
    with served(tmp_path, "tmcm@5", *words) as joined:
        assert gen4.dvtcli("-n", "5", "read", "1018:1").stdout.startswith(f"{VENDOR}646 ")
        assert joined.dvtcli("-n", "5", "read", "1018:1").stdout.startswith(f"{VENDOR}646 ")
        assert joined.dvtcli("-n", "1", "read", "1018:1").stdout.startswith(f"{VENDOR}30 ")
        joined.end()
        assert f"and on socketcand:127.0.0.1:{gen4.port}: node 5 tmcm" in joined.said
    assert gen4.dvtcli("--timeout", "0.5", "-n", "5", "read", "1018:1").returncode == 5


def test_a_bus_that_ends_ends_the_nodes_on_it(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1") as first:
        words = ["-i", "socketcand", "-c", "can0", "--bus-kwargs", "host=127.0.0.1", "--bus-kwargs"]
        with served(tmp_path, "tmcm@5", *words, f"port={first.port}") as joined:
            first.end()
            assert joined.process.wait(PATIENCE_S) == 5
            joined.end()
            assert "failed" in joined.complaints


def test_a_bus_that_is_not_there_is_said(tmp_path: Path) -> None:
    """AF_CAN is missing on many machines; the answer is an error then, and no traceback."""
    if hasattr(socket, "AF_CAN"):
        try:
            socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
        except OSError:
            pass
        else:
            pytest.skip("this machine has AF_CAN")
    ran = dvtcli("sim", "gen4", "-i", "socketcan", "-c", "vcan0")
    assert ran.returncode == 5
    assert "cannot open socketcan:vcan0" in ran.stderr


def why_no_vcan() -> str:
    """What keeps this machine from having a bus vcan0; empty where it has one."""
    if not hasattr(socket, "AF_CAN"):
        return "this Python has no AF_CAN"
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
            bus.bind(("vcan0",))
    except OSError as failed:
        return f"no vcan0: {failed.strerror} (ip link add vcan0 type vcan; ip link set vcan0 up)"
    return ""


@pytest.mark.skipif(bool(why_no_vcan()), reason=why_no_vcan())
@pytest.mark.parametrize("own", [(), ("--bus-kwargs", "receive_own_messages=true")], ids=["no echoes", "echoes"])
def test_nodes_on_a_bus_of_the_kernel(tmp_path: Path, own: tuple[str, ...]) -> None:
    """Every frame here comes from our own host, and is marked so; with echoes, our own come back as well."""
    with served(tmp_path, "gen4@1", "-i", "socketcan", "-c", "vcan0", *own):
        bus = ("-i", "socketcan", "-c", "vcan0", *own)
        assert dvtcli(*bus, "-n", "1", "read", "1018:1").stdout.startswith(f"{VENDOR}30 ")
        ran = dvtcli(*bus, "-n", "1", "map", "tpdo1", "6041", "606C/32", "--sync", "1")
        assert ran.returncode == 0, ran.stderr
        assert "another SDO client" not in ran.stderr
        with can.Bus(interface="socketcan", channel="vcan0", ignore_config=True) as other:
            other.send(can.Message(arbitration_id=0, data=[1, 1], is_extended_id=False))
            other.send(can.Message(arbitration_id=0x080, is_extended_id=False))
            while received_but_heartbeats(other, 1) != [(0x181, "500224faffff")]:
                pass


def test_faults_happen_and_a_dead_bus_cuts_everybody_off(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1", "--fault", "refuse@2=0x06040041", "--fault", "bus-error@20") as server:
        ran = server.dvtcli("-n", "1", "map", "tpdo1", "6041", "606C/32", "--sync", "1")
        assert (ran.returncode, "0x06040041" in ran.stderr) == (1, True), ran.stderr
        for number in range(20):
            ran = server.dvtcli("-n", "1", "set", "tpdo1", "--timer", str(100 + number))
            if ran.returncode:
                break
        assert ran.returncode in (5, 7)
        server.end()
        assert "the bus is dead (a simulated fault)" in server.complaints


@pytest.mark.long
def test_a_bit_rate_is_kept(tmp_path: Path) -> None:
    """40 SYNCs with four frames of 8, 7, 8 and 6 bytes at 20 kbit/s take 40 x some 500 bits: 1 s."""
    with served(tmp_path, "gen4@1", "-b", "20000") as server:
        assert server.dvtcli("-n", "1", "run", "scripts/pdo_config.dvt").returncode == 0
        bus = server.attach()
        bus.send(can.Message(arbitration_id=0, data=[1, 1], is_extended_id=False))
        sender = threading.Thread(
            target=lambda: [bus.send(can.Message(arbitration_id=0x080, is_extended_id=False)) for _ in range(40)]
        )
        sender.start()
        frames = [frame for frame in received(bus, 165) if frame.arbitration_id < 0x500]
        sender.join()
        times = [frame.timestamp for frame in frames[:160:4]]
        pairs = combinations(enumerate(times), 2)  # a busy machine sends some of them late
        seconds = median((later - earlier) / (last - first) for (first, earlier), (last, later) in pairs)
        assert seconds >= 0.9 * (51 + 117 + 110 + 121 + 102) / 20000


def test_a_state_folder_that_cannot_be_made_is_said_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", "utf-8")
    ran = dvtcli("sim", "generic", "--listen", "127.0.0.1:0", "--state", str(tmp_path / "file" / "kept"))
    assert ran.returncode == 2
    assert "Not a directory" in ran.stderr
