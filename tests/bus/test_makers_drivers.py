"""python-can's PCAN and gs_usb drivers as far as they go without hardware: found, opened, used, unplugged, or missing.

PCAN-Basic is a library of our own (`pcanbasic.c`), which a C compiler makes here: python-can's driver calls it as it
calls PEAK's.
"""

from __future__ import annotations

import json
import shutil
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

import can
import pytest

from tests.cli.commands.bus import device
from tests.harness.forked import Fresh
from tests.process import PATIENCE_S, Ran, environment, run
from tests.served_nodes import ServedNodes
from tests.simulator.serve.served import wait_for
from tests.socketcan.recorded import interrupted, seen_by

pytestmark = pytest.mark.drawn(4, "makers drivers")

_NUMBERS = count(1)
_MESSAGE = struct.Struct("=IBB8s2x")
#: PCAN-Basic's words for bit rates
_500_KBIT = b"B\x00\x1c"

needs_compiler = pytest.mark.skipif(
    sys.platform != "linux" or not (shutil.which("cc") and shutil.which("objdump")),
    reason="no C compiler with binutils, by which the library is made and found",
)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with libpcanbasic.so in it."""
    folder = tmp_path_factory.mktemp("pcan")
    source = Path(__file__).with_name("pcanbasic.c")
    made = folder / "libpcanbasic.so"
    words = ["cc", "-Wall", "-Werror", "-shared", "-fPIC", f"-Wl,-soname,{made.name}", "-o", str(made), str(source)]
    subprocess.run(words, check=True, capture_output=True)
    return folder


class Adapter:
    """The other end of the library's wire: a Gen4 as node 1 on the bus that the adapter is plugged into."""

    def __init__(self, library: Path, folder: Path) -> None:
        self._library, self._path = library, folder / "wire"
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(str(self._path))
        self._listener.listen(1)
        channel = f"pcan-{next(_NUMBERS)}"
        self._ours, self._theirs = (
            can.Bus(channel, interface="virtual", ignore_config=True, receive_own_messages=False) for _ in range(2)
        )
        self._node = ServedNodes(self._theirs, [device("gen4")])
        self._node.start()
        self._line: socket.socket | None = None
        self.bit_rate = b""
        #: after so many frames from the program the plug is pulled; 0: never
        self.unplugged_after = 0
        self._threads = [threading.Thread(target=self._serve, daemon=True)]
        self._threads[0].start()

    @property
    def variables(self) -> dict[str, str]:
        """An environment in which python-can finds the library."""
        return environment() | {"LD_LIBRARY_PATH": str(self._library), "TESTS_PCAN_WIRE": str(self._path)}

    def dvtcli(self, *words: str) -> Ran:
        """Run dvtcli on this adapter."""
        return _fresh(words, self.variables)

    def unplug(self) -> None:
        """Pull the plug; it is plugged in again at once."""
        if self._line is not None:
            self._line.shutdown(socket.SHUT_RDWR)

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                line, _ = self._listener.accept()
                self._line = line
                with line:
                    self._connected(line)

    def _connected(self, line: socket.socket) -> None:
        """Until the program has gone; one that left something unread resets the connection."""
        over = threading.Event()
        back = threading.Thread(target=self._back, args=(line, over), daemon=True)
        back.start()
        with suppress(OSError):
            self._forth(line)
        over.set()
        back.join()

    def _forth(self, line: socket.socket) -> None:
        self.bit_rate, frames = line.recv(16), 0
        while data := line.recv(64):
            number, kind, length, content = _MESSAGE.unpack(data)
            frames += 1
            if frames == self.unplugged_after:
                return
            self._ours.send(can.Message(arbitration_id=number, is_extended_id=bool(kind & 2), data=content[:length]))

    def _back(self, line: socket.socket, over: threading.Event) -> None:
        while not over.is_set():
            frame = self._ours.recv(0.02)
            if frame is not None:
                with suppress(OSError):
                    line.send(
                        _MESSAGE.pack(frame.arbitration_id, 2 * frame.is_extended_id, frame.dlc, bytes(frame.data))
                    )

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for thread in self._threads:
            thread.join(PATIENCE_S)
        self._node.stop()
        self._ours.shutdown()
        self._theirs.shutdown()


def event(row: dict[str, Any]) -> str | None:
    """What a document of `monitor` says of the bus."""
    return row["event"] if row["schema"] == "dvtcli.bus/1" else None


def _fresh(words: tuple[str, ...], variables: dict[str, str]) -> Ran:
    """dvtcli in a Python of its own: where libraries are looked for is read at its start."""
    return subprocess.run(
        [sys.executable, "-m", "dvtcli", *words], env=variables, capture_output=True, text=True, timeout=PATIENCE_S,
        check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip


@pytest.fixture
def adapter(library: Path, tmp_path: Path) -> Iterator[Adapter]:
    made = Adapter(library, tmp_path)
    yield made
    made.close()


PCAN = ("-i", "pcan", "-c", "PCAN_USBBUS1", "-b", "500000", "-n", "1", "--yes")


@needs_compiler
def test_a_change_and_a_proven_store_over_pcan(adapter: Adapter) -> None:
    ran = adapter.dvtcli(*PCAN, "map", "tpdo1", "6041", "606C/32", "--sync", "1")
    assert ran.returncode == 0, ran.stderr
    assert adapter.bit_rate == _500_KBIT
    ran = adapter.dvtcli(*PCAN, "store", "--prove")
    assert ran.returncode == 0, ran.stderr
    assert "proved" in ran.stdout


@needs_compiler
def test_scan_log_and_a_monitor_that_goes_on_after_the_plug_was_pulled(adapter: Adapter, tmp_path: Path) -> None:
    ran = adapter.dvtcli(*PCAN, "scan", "--json")
    assert [row["node"] for row in json.loads(ran.stdout)["nodes"]] == [1], ran.stderr
    path = tmp_path / "run.log"
    recording = Fresh([*PCAN, "log", str(path)], env=adapter.variables)
    wait_for(lambda: path.exists() and " 701#" in path.read_text("utf-8"), "a heartbeat in the file")
    interrupted(recording)
    watching = Fresh([*PCAN, "monitor", "--json"], env=adapter.variables)
    wait_for(lambda: '"heartbeat"' in watching.so_far()[0], "a heartbeat")
    adapter.unplug()
    rows = seen_by(watching, lambda rows: rows[-1]["schema"] == "dvtcli.frame/1" and "back" in map(event, rows))
    assert [event(row) for row in rows if event(row)] == ["gone", "back"]


@needs_compiler
def test_doctor_finds_the_adapter(adapter: Adapter) -> None:
    ran = adapter.dvtcli("doctor", "--json")
    found = [one["text"] for one in json.loads(ran.stdout)["checks"] if one["check"] == "interface"]
    assert "pcan PCAN_USBBUS1  PCAN-USB" in found


@needs_compiler
def test_a_plug_that_is_pulled_in_the_middle_of_a_change(adapter: Adapter) -> None:
    before = adapter.dvtcli(*PCAN, "pdo", "tpdo1", "--json").stdout
    whole = len(before) and adapter.dvtcli(*PCAN, "map", "tpdo1", "6041", "606C/32", "--dry-run").returncode
    assert whole == 0
    adapter.unplugged_after = 55
    ran = adapter.dvtcli(*PCAN, "set", "tpdo1", "--timer", "70")
    assert ran.returncode in (5, 7), ran.stderr
    assert "The hardware handle is invalid" in ran.stderr
    adapter.unplugged_after = 0
    assert adapter.dvtcli(*PCAN, "recover").returncode == 0
    assert adapter.dvtcli(*PCAN, "pdo", "tpdo1", "--json").stdout == before


@needs_compiler
def test_without_a_bit_rate_it_is_said_which_one_it_is(adapter: Adapter) -> None:
    ran = adapter.dvtcli("-i", "pcan", "-c", "PCAN_USBBUS1", "-n", "1", "read", "1018:1")
    assert ran.returncode == 0, ran.stderr
    assert "no bit rate was given: pcan runs at 500000 bit/s" in ran.stderr


@needs_compiler
def test_a_channel_that_is_not_there(adapter: Adapter) -> None:
    ran = adapter.dvtcli("-i", "pcan", "-c", "PCAN_USBBUS2", "-b", "500000", "-n", "1", "read", "1000")
    assert ran.returncode == 5
    assert "The hardware handle is invalid" in ran.stderr
    assert "is the adapter plugged in" in ran.stderr


def test_a_bit_rate_that_pcan_has_not_is_not_another_one() -> None:
    ran = run(["-i", "pcan", "-c", "PCAN_USBBUS1", "-b", "300000", "-n", "1", "read", "1000"])
    assert ran.returncode == 5
    assert "cannot run at 300000 bit/s" in ran.stderr
    assert "125000, 250000, 500000" in ran.stderr


@pytest.mark.parametrize(
    ("interface", "install"),
    [("pcan", "install PEAK's PCAN-Basic"), ("kvaser", "install Kvaser's CANlib"), ("gs_usb", "python-can[gs-usb]")],
)
def test_a_driver_that_is_missing_is_told_with_what_to_install(interface: str, install: str) -> None:
    if interface == "gs_usb" and not missing("usb"):
        pytest.skip("pyusb is installed")
    ran = run(["-i", interface, "-c", "0", "-b", "500000", "-n", "1", "read", "1000"])
    if "missing" not in ran.stderr and "not installed" not in ran.stderr and "not found" not in ran.stderr:
        pytest.skip(f"{interface} is installed")
    assert ran.returncode == 5
    assert install in ran.stderr
    assert "is not defined" not in ran.stderr
    if sys.platform == "linux" and interface != "gs_usb":
        assert "-i socketcan -c can0" in ran.stderr


def missing(module: str) -> bool:
    from importlib.util import find_spec

    return find_spec(module) is None
