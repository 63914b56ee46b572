"""What interfaces this machine has, and what error frames mean."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import count
from pathlib import Path

import can
import pytest

from dvtcli.bus.discover import FoundInterface, InterfaceSearch, adapters, find_interfaces, serial_ports
from dvtcli.bus.opening import open_bus
from tests.harness.sample import heavy
from tests.process import environment

_NUMBERS = count(1)


@heavy
def test_drivers_are_asked_in_a_process_of_their_own() -> None:
    ((found,), unanswered) = adapters(["virtual"])
    assert (found.interface, unanswered) == ("virtual", ())
    assert adapters(["nosuch"]) == InterfaceSearch([])


def _driver(folder: Path, name: str, detection: str) -> None:
    """Make the package *name* with a python-can driver, whose detection has the lines *detection*."""
    (folder / f"{name}.py").write_text(
        "import os, time, can\n"
        "class Bus(can.BusABC):\n"
        "    @staticmethod\n"
        "    def _detect_available_configs():\n" + detection,
        encoding="utf-8",
    )
    (folder / f"{name}-1.dist-info").mkdir()
    (folder / f"{name}-1.dist-info" / "METADATA").write_text(f"Name: {name}\nVersion: 1\n")
    (folder / f"{name}-1.dist-info" / "entry_points.txt").write_text(f"[can.interface]\n{name} = {name}:Bus\n")


def test_a_driver_may_print_what_it_likes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _driver(
        tmp_path,
        "noisy",
        "        os.write(1, b'\\xff\\xfe looking\\n')\n        return [{'interface': 'noisy', 'channel': '\u00e9'}]\n",
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert adapters(["noisy"]) == InterfaceSearch([FoundInterface("noisy", "\u00e9")])


def test_a_process_that_ends_without_an_answer_leaves_all_drivers_unknown() -> None:
    assert adapters(["virtual"], patience_s=0.001) == InterfaceSearch([], ("virtual",))
    assert adapters(patience_s=0.001) == InterfaceSearch([], ("any driver",))


def test_a_driver_that_hangs_is_named_and_the_others_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _driver(tmp_path, "stuck", "        time.sleep(600)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    code = "from dvtcli.bus.drivers import main; main(['stuck', 'virtual'], 5.0)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    answer = json.loads(ran.stdout)
    assert answer["unanswered"] == ["stuck"]
    assert [row["interface"] for row in answer["found"]] == ["virtual"]


@heavy
def test_doctor_does_not_say_none_if_a_driver_ended_the_search(tmp_path: Path) -> None:
    _driver(tmp_path, "deadly", "        os._exit(3)\n")
    ran = subprocess.run(
        [sys.executable, "-m", "dvtcli", "doctor", "--json"],
        env=environment() | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    (row,) = [row for row in json.loads(ran.stdout)["checks"] if row["check"] == "interface"]
    assert (row["verdict"], row["text"]) == ("warn", "unknown adapters: no answer from any driver")


@heavy
def test_looking_for_everything_never_fails() -> None:
    assert all(one.interface not in ("virtual", "udp_multicast", "socketcand") for one in find_interfaces().found)


@pytest.mark.skipif(sys.platform == "win32", reason="ports are told by the registry")
def test_serial_ports_that_may_not_be_opened_say_so(tmp_path: Path) -> None:
    assert serial_ports(str(tmp_path)) == []
    port = tmp_path / "ttyUSB0"
    port.touch()
    (found,) = serial_ports(str(tmp_path))
    assert (found.interface, found.channel, found.problem) == ("slcan", str(port), None)


@pytest.mark.parametrize(
    ("error_class", "data", "times", "text"),
    [
        (0x040, b"", 1, "went bus-off"),
        (0x100, b"", 1, "was bus-off and is restarted"),
        (0x004, b"\x00\x10", 1, "error-passive"),
        (0x004, b"\x00\x04", 1, "counts many errors"),
        (0x020, b"", 1, "no other node acknowledges"),
        (0x008, b"\x00\x00\x04", 5, "carries error frames"),
    ],
)
def test_error_frames_are_explained_once(error_class: int, data: bytes, times: int, text: str) -> None:
    channel = f"error-frames-{next(_NUMBERS)}"
    bus = open_bus("virtual", channel)
    other = can.Bus(channel, interface="virtual", ignore_config=True)
    try:
        for _ in range(times):
            other.send(can.Message(arbitration_id=error_class, data=data, is_error_frame=True))
        (told,) = bus.disturbances()
        assert text in told
        assert bus.disturbances() == []
        assert bus.error_frames.count == times
    finally:
        other.shutdown()
        bus.close()


def test_a_controller_that_goes_off_again_after_its_restart_is_told_again() -> None:
    channel = f"error-frames-{next(_NUMBERS)}"
    bus = open_bus("virtual", channel)
    other = can.Bus(channel, interface="virtual", ignore_config=True)
    told = []
    try:
        for error_class in (0x040, 0x040, 0x100, 0x040):
            other.send(can.Message(arbitration_id=error_class, is_error_frame=True))
            told += [text.partition(":")[0].removeprefix("the CAN controller ") for text in bus.disturbances()]
    finally:
        other.shutdown()
        bus.close()
    assert told == ["went bus-off", "was bus-off and is restarted", "went bus-off"]


def test_a_single_error_frame_is_no_news() -> None:
    channel = f"error-frames-{next(_NUMBERS)}"
    bus = open_bus("virtual", channel)
    other = can.Bus(channel, interface="virtual", ignore_config=True)
    try:
        other.send(can.Message(arbitration_id=0x008, data=b"\x00\x00\x04", is_error_frame=True))
        assert bus.disturbances() == []
        assert bus.error_frames.count == 1
    finally:
        other.shutdown()
        bus.close()
