"""A new way to a bus is one file (`line_gateway`): map, verify and store run over a gateway on the loopback."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from select import select

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.object_syntax import MappedObject
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.domain.ports import BootUp, CanopenBus, Frame, NodeEvent
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import BusUnavailable, DvtcliError, NoAnswer, SdoAborted, SdoProtocolError, UsageError
from dvtcli.operations.changes.change import configure
from dvtcli.operations.changes.store_restore import store_settings
from dvtcli.operations.devices.verify_nodes import verify
from dvtcli.operations.frames.layouts import open_wire
from dvtcli.operations.nodes.find_nodes import find_nodes
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.network.in_process_bus import simulate
from tests.bus import line_gateway
from tests.bus.devices import device
from tests.bus.test_contract import Contract
from tests.harness.sample import heavy
from tests.process import PATIENCE_S
from tests.surroundings import ROOT

TPDO1 = Pdo(Direction.TPDO, 1)
_NMT = {word: command for command, word in line_gateway._WORDS.items()}


class Gateway:
    """Serves simulated nodes to one client at a time, by lines; it knows no more of them than their objects."""

    def __init__(self, *nodes: tuple[int, str]) -> None:
        self.bus = simulate([device(node_id, family) for node_id, family in nodes], timeout_s=0.2, retries=0)
        self._nodes = {node_id for node_id, _ in nodes}
        self.asked: list[str] = []
        #: what is said to a client instead of an answer, by a part of the line that it follows
        self.wrong: dict[str, str] = {}
        self._said: list[bytes] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.channel = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._leaving = False
        self.bus.nodes_seen()  # who starts before a client is there is not told
        self.bus.on_event(self._tell)
        self._thread = threading.Thread(target=self._serve, name="gateway")
        self._thread.start()

    def close(self) -> None:
        self._leaving = True
        self._thread.join()
        self._listener.close()
        self.bus.close()

    def _tell(self, event: NodeEvent) -> None:
        if isinstance(event, BootUp):
            self._said.append(f"1 {event.node_id} BOOT_UP\r\n".encode())

    def _serve(self) -> None:
        while not self._leaving:
            if select([self._listener], [], [], 0.01)[0]:
                link, _ = self._listener.accept()
                self._said.clear()
                with link, suppress(ConnectionError):  # a client may leave at any time
                    self._talk(link)
            self.bus.idle(0.005)

    def _talk(self, link: socket.socket) -> None:
        rest = b""
        while not self._leaving:
            if select([link], [], [], 0.005)[0]:
                data = link.recv(4096)
                if not data:
                    return
                *lines, rest = (rest + data).split(b"\n")
                for line in lines:
                    answer = self._answered(line.decode("ascii").strip())
                    if answer is None:
                        return
                    link.sendall(answer.encode())
            self.bus.idle(0.001)
            while self._said:
                link.sendall(self._said.pop(0))

    def _answered(self, line: str) -> str | None:
        self.asked.append(line)
        number, words = re.fullmatch(r"\[(\d+)\] 1 (.*)", line).groups()  # type: ignore[union-attr]
        for part, wrong in self.wrong.items():
            if part in words:
                return None if wrong == "hang up" else wrong.replace("N", number)
        if re.match(r"\d+ [rw] ", words) and int(words.split()[0]) not in self._nodes:
            return f"[{number}] ERROR:103 #Time-out.\r\n"  # at once: nobody needs to wait for a node that is not there
        try:
            return f"[{number}] {self._done(words)}\r\n"
        except SdoAborted as aborted:
            return f"[{number}] ERROR:0x{aborted.code:08X} #as the node says\r\n"
        except NoAnswer:
            return f"[{number}] ERROR:103 #Time-out.\r\n"

    def _done(self, words: str) -> str:
        if match := re.fullmatch(r"set sdo_timeout (\d+)", words):
            self.bus.set_timeout(int(match[1]) / 1000)
            return "OK"
        if match := re.fullmatch(r"(\d+) r (0x\w+) (\d+) hex", words):
            return self.bus.sdo(int(match[1])).upload(int(match[2], 16), int(match[3])).hex(" ").upper()
        if match := re.fullmatch(r"(\d+) w (0x\w+) (\d+) hex ([\w ]*)", words):
            self.bus.sdo(int(match[1])).download(int(match[2], 16), int(match[3]), bytes.fromhex(match[4]))
            return "OK"
        node_id, word = words.split(" ", 1)
        self.bus.send_nmt(_NMT[word], int(node_id))
        return "OK"


def connected(gateway: Gateway, *, timeout_s: float = 20.0, retries: int = 0) -> CanopenBus:
    return line_gateway.open_bus(gateway.channel, None, {}, timeout_s=timeout_s, retries=retries)


def opened(options: Options) -> CanopenBus:
    return line_gateway.open_bus(options.channel, options.bitrate, {}, timeout_s=options.timeout, retries=1)


@pytest.fixture
def gateway() -> Iterator[Gateway]:
    gateway = Gateway((1, "generic"), (2, "generic"), (5, "gen4"))
    yield gateway
    gateway.close()


class TestGateway(Contract):
    @pytest.fixture
    def bus(self, gateway: Gateway) -> Iterator[CanopenBus]:
        bus = connected(gateway)
        yield bus
        bus.close()

    def test_no_frames_pass_and_that_is_said(self, bus: CanopenBus) -> None:
        assert (bus.carries_frames, bus.carries_remote_frames, bus.simulated) == (False, False, False)
        with pytest.raises(UsageError, match="carries no CAN frames: 0x080 cannot be sent"):
            bus.send(Frame(0x80, b""))

    def test_who_taps_sees_boot_ups(self, bus: CanopenBus) -> None:
        seen: list[tuple[int, bool]] = []
        bus.tap(lambda frame, sent: seen.append((frame.can_id, sent)))
        before = bus.boot_ups(2)
        bus.send_nmt(NmtCommand.RESET_NODE, 2)
        assert bus.wait_boot_up(2, before, PATIENCE_S)
        assert (0x702, False) in seen

    def test_a_silent_node_is_asked_again_as_often_as_is_said(self, bus: CanopenBus, gateway: Gateway) -> None:
        before = bus.disturbance_count(9)
        with pytest.raises(NoAnswer, match=r"within 0\.03 s"):
            bus.sdo(9).upload(0x1000, 0, timeout_s=0.03, retries=2)
        assert sum("9 r 0x1000 0 hex" in line for line in gateway.asked) == 3
        assert bus.disturbance_count(9) == before + 2
        with pytest.raises(NoAnswer) as caught:
            bus.sdo(9).download(0x1017, 0, bytes(2), timeout_s=0.03)
        assert caught.value.state == "unknown"

    @pytest.mark.parametrize("wrong", ["[N] 2B 0\r\n", "[N] ERROR:101 #Syntax error.\r\n", "[N] OK\r\n"])
    def test_an_answer_that_is_none_is_said(self, bus: CanopenBus, gateway: Gateway, wrong: str) -> None:
        gateway.wrong["0x1000"] = wrong
        with pytest.raises(SdoProtocolError, match="the gateway's answer for node 1 is none"):
            bus.sdo(1).upload(0x1000, 0)
        assert len(bus.sdo(1).upload(0x1001, 0)) == 1

    def test_who_waits_learns_that_the_gateway_left(self, bus: CanopenBus, gateway: Gateway) -> None:
        gateway.wrong["0x1000"] = "hang up"
        with pytest.raises(BusUnavailable, match="failed") as caught:
            bus.sdo(1).upload(0x1000, 0)
        assert "closed the connection" in str(caught.value.why)


@heavy
@pytest.mark.parametrize("node_id", [1, 5])
def test_map_verify_and_store_run_over_it(gateway: Gateway, node_id: int) -> None:
    options = Options(interface="line-gateway", channel=gateway.channel, node=node_id, yes=True, timeout=20)
    with Session(options, open_bus=opened) as session:
        want = PdoRequest(cob_id=0x180 + node_id, event_timer=70, objects=(MappedObject(0x1001, 0, 8),), enabled=True)
        before = gateway.bus.sdo(node_id).upload(0x1A00, 1)
        with session.under(dry_run=True):
            assert configure(session, session.node(), {TPDO1: want}).dry_run
        assert gateway.bus.sdo(node_id).upload(0x1A00, 1) == before
        assert configure(session, session.node(), {TPDO1: want}).exit_code == 0
        held = session.node().pdo(TPDO1)
        assert (held.communication.cob_id.can_id, held.communication.event_timer) == (0x180 + node_id, 70)
        assert verify(session, lambda _file, _node_id=None: {}).exit_code == 0
        stored = store_settings(session, session.node(), None, prove="reset")
        assert (stored.exit_code, stored.proof is not None) == (0, True)
    assert gateway.bus.sdo(node_id).upload(0x1A00, 1) == bytes.fromhex("08 00 01 10")
    assert gateway.bus.sdo(node_id).upload(0x1800, 5) == bytes.fromhex("46 00")


def test_a_refusal_rolls_back_over_it(gateway: Gateway) -> None:
    options = Options(interface="line-gateway", channel=gateway.channel, node=5, yes=True, force=True)
    with Session(options, open_bus=opened) as session:
        before = session.node().pdo(TPDO1)
        with pytest.raises(DvtcliError):
            configure(session, session.node(), {TPDO1: PdoRequest(objects=(MappedObject(0x5FFF, 1, 8),))})
        assert session.node().pdo(TPDO1) == before
        with pytest.raises(UsageError, match="there is nothing to listen to"):
            open_wire(session)


@heavy
def test_scan_finds_nodes_over_it(gateway: Gateway) -> None:
    with Session(Options(interface="line-gateway", channel=gateway.channel), open_bus=opened) as session:
        assert [row.node for row in find_nodes(session, 5).rows] == [1, 2, 5]


@pytest.mark.parametrize("channel", [None, "nohost", "host:", ":1", "host:x", "host:99999"])
def test_a_channel_that_is_none_is_said_with_what_is_one(channel: str | None) -> None:
    with pytest.raises(UsageError, match="a gateway is HOST:PORT") as raised:
        line_gateway.open_bus(channel, None, {}, timeout_s=0.1, retries=0)
    assert "-c" in typed(raised.value.hint)


@heavy
def test_the_program_finds_it_by_its_entry_point(gateway: Gateway, tmp_path: Path) -> None:
    info = tmp_path / "line_gateway-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: line-gateway\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[dvtcli.bus]\nline-gateway = tests.bus.line_gateway:open_bus\n")
    (tmp_path / "set-up.dvt").write_text("map tpdo1 1001 --cob-id 0x185\nverify\nstore --prove\n")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}

    def ran(*words: str, interface: str = "line-gateway") -> subprocess.CompletedProcess[str]:
        whole = [sys.executable, "-m", "dvtcli", "-i", interface, *words]
        return subprocess.run(whole, env=env, cwd=tmp_path, capture_output=True, text=True, check=False)

    done = ran("-c", gateway.channel, "-n", "5", "run", "set-up.dvt", "--yes")
    assert (done.returncode, done.stderr) == (0, done.stderr), done.stderr
    assert gateway.bus.sdo(5).upload(0x1A00, 1) == bytes.fromhex("08 00 01 10")
    listening = ran("-c", gateway.channel, "-n", "5", "monitor", "--duration", "1", "--json")
    assert (listening.returncode, "carries no CAN frames" in listening.stdout) == (2, True)
    nobody = ran("-c", "127.0.0.1:1", "-n", "5", "pdo")
    assert nobody.returncode == 5
    assert "cannot open line-gateway:127.0.0.1:1" in nobody.stderr
    assert "line-gateway" in ran("pdo", interface="line-gatewy").stderr
