"""Other programs and other traffic on the same bus: canopen, can-utils, error, 29-bit and FD frames, full queues."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import can
import canopen
import pytest

from dvtcli.bus.opening import open_bus
from dvtcli.bus.python_can import CanBus
from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import device
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device as family_device
from tests.process import PATIENCE_S, start
from tests.simulator.serve.served import own_environment, wait_for
from tests.socketcan.conftest import ANSWER_S, ip, on, tool
from tests.socketcan.recorded import seen_by

OPTIONS = {"interface": "socketcan", "channel": "vcan0", "node": 1, "timeout": ANSWER_S}


@pytest.fixture
def bus() -> Iterator[CanBus]:
    opened = open_bus("socketcan", "vcan0", timeout_s=ANSWER_S)
    yield opened
    opened.close()


def test_canopen_reads_what_was_mapped_while_dvtcli_watches(bus: CanBus) -> None:
    with on("vcan0", family_device("gen4")), Bench((), OPTIONS) as bench:
        assert bench.run("map tpdo1 6041 606C/32 --sync 1").code == 0
        network = canopen.Network()
        network.connect(interface="socketcan", channel="vcan0", ignore_config=True)
        try:
            other = network.add_node(1, canopen.ObjectDictionary())
            other.sdo.RESPONSE_TIMEOUT = ANSWER_S
            assert other.sdo.upload(0x1A00, 0) == b"\x02"
            assert other.sdo.upload(0x1A00, 2) == bytes.fromhex("20006C60")
        finally:
            network.disconnect()
        bench.run("read 1000")
        assert bus.downloads_of_others(1) > 0, "dvtcli itself is another client to a bus beside it"


def test_what_cangen_sends_is_decoded(tmp_path: Path) -> None:
    with on("vcan0", family_device("gen4")), Bench((), OPTIONS) as bench:
        assert bench.run("map tpdo1 6041 606C/32 --sync 1").code == 0
        words = ["cangen", "vcan0", "-g", "100", "-I", "181", "-L", "6", "-D", "371224FAFFFF"]
        watched = ["-i", "socketcan", "-c", "vcan0", "--timeout", str(ANSWER_S), "--eds", str(family_eds("gen4"))]
        watching = start([*watched, "monitor", "--nodes", "1", "--json"], env=own_environment(tmp_path))
        with subprocess.Popen(words, stdin=subprocess.DEVNULL) as generator:
            rows = seen_by(watching, lambda rows: "tpdo1" in {row.get("pdo") for row in rows})
            generator.terminate()
    (tpdo1, *_) = [row for row in rows if row.get("pdo") == "tpdo1"]
    assert list(tpdo1["signals"].values()) == [0x1237, -1500]


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("20000004#0010000000000000", "error-passive"),
        ("20000004#0004000000000000", "counts many errors"),
        ("20000020#0000000000000000", "no other node acknowledges"),
        ("20000040#0000000000000000", "went bus-off"),
        ("20000100#0000000000000000", "was bus-off and is restarted"),
    ],
)
def test_error_frames_are_told_in_words(frame: str, words: str) -> None:
    """On a pair: what is sent with the error flag on one end is the other end's controller's complaint."""
    with on("vxcan1", device(1)):
        bus = open_bus("socketcan", "vxcan0", timeout_s=ANSWER_S)
        tool("cansend", "vxcan1", frame)
        bus.sdo(1).upload(0x1000, 0)
        (told,) = bus.disturbances()
        bus.close()
    assert words in told
    assert bus.error_frame_count() == 1


def test_29_bit_frames_are_nobodys_answers(bus: CanBus) -> None:
    with on("vcan0", device(1)):
        assert bus.sdo(1).upload(0x1000, 0) == device(1).upload(0x1000, 0)
        before = bus.boot_ups(1)
        seen: list[Frame] = []
        bus.tap(lambda frame, _sent: seen.append(frame))
        for can_id, data in (
            ("00000581", "4300100000000000"),
            ("00000701", "00"),
            ("18FF0701", "01"),
            ("00000081", "10810100"),
        ):
            tool("cansend", "vcan0", f"{can_id}#{data}")
        assert bus.sdo(1).upload(0x1000, 0) == device(1).upload(0x1000, 0)
        assert (bus.boot_ups(1), bus.emergency(1)) == (before, None)
        assert sum(frame.extended for frame in seen) == 4


def test_fd_frames_are_not_heard() -> None:
    """A socket that did not ask for FD frames gets none, whatever the link carries."""
    ip("add", "vcan8", "mtu", "72", "type", "vcan")
    ip("set", "vcan8", "up")
    bus = open_bus("socketcan", "vcan8", timeout_s=ANSWER_S)
    with on("vcan8", device(1)):
        seen: list[Frame] = []
        bus.tap(lambda frame, _sent: seen.append(frame))
        tool("cansend", "vcan8", "181##1" + "00" * 32)
        tool("cansend", "vcan8", "182#01")
        assert bus.sdo(1).upload(0x1000, 0) == device(1).upload(0x1000, 0)
    bus.close()
    ip("del", "vcan8")
    assert {frame.can_id for frame in seen} - {0x701} == {0x182, 0x601, 0x581}


def test_a_full_queue_is_waited_for(bus: CanBus) -> None:
    """A queue of some ten frames that lets one through each few milliseconds."""
    shape = ["root", "tbf", "rate", "64kbit", "burst", "64", "limit", "400"]
    subprocess.run(["tc", "qdisc", "add", "dev", "vcan0", *shape], check=True, capture_output=True)
    try:
        with can.Bus("vcan0", interface="socketcan", ignore_config=True) as other:
            for number in range(100):
                bus.send(Frame(0x201, bytes([number])))
            received = [other.recv(PATIENCE_S) for _ in range(100)]
        assert [message and message.data[0] for message in received] == list(range(100))
    finally:
        subprocess.run(["tc", "qdisc", "del", "dev", "vcan0", "root"], check=True)


def test_the_kernel_keeps_pdos_from_who_asks_only(bus: CanBus) -> None:
    """What came before somebody wanted every frame is not there; what comes after it is."""
    pdos = ("cangen", "vcan0", "-g", "1", "-I", "181", "-L", "8", "-D", "i", "-n", "20")
    received: list[int] = []
    with on("vcan0", family_device("gen4")):
        tool(*pdos)
        bus.tap(lambda frame, _sent: received.append(frame.can_id))
        assert bus.sdo(1).upload(0x1018, 1)
        assert 0x581 in received
        assert 0x181 not in received
        tool(*pdos)
        bus.drain()
    assert received.count(0x181) == 20


def test_times_are_the_kernels(bus: CanBus) -> None:
    seen: list[Frame] = []
    bus.tap(lambda frame, _sent: seen.append(frame))
    began_s = time.time()
    tool("cansend", "vcan0", "181#01")
    wait_for(lambda: bus.sleep(0.1) or seen, "the frame")
    (frame,) = seen
    assert began_s <= frame.timestamp_s <= time.time()
