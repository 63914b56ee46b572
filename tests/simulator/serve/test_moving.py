"""Signals, the plant and lost heartbeats of nodes in another process, as other programs see them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import can

from tests.process import dvtcli
from tests.simulator.serve.served import PATIENCE_S, Served, served

VELOCITY = 0x181


def first(bus: can.BusABC, wanted: Callable[[can.Message], bool]) -> can.Message:
    """The next frame that is *wanted*."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        frame = bus.recv(0.5)
        if frame is not None and wanted(frame):
            return frame
    raise AssertionError("no such frame")


def velocities(bus: can.BusABC, until: Callable[[list[int]], bool]) -> list[int]:
    """The velocities that TPDO1 shows, until they are enough."""
    seen: list[int] = []
    while not until(seen):
        frame = first(bus, lambda frame: frame.arbitration_id == VELOCITY)
        seen.append(int.from_bytes(frame.data[:4], "little", signed=True))
    return seen


def with_velocity_on_tpdo1(server: Served) -> can.BusABC:
    """A client that hears TPDO1 with 606C on change, the node being started."""
    bus = server.attach()
    ran = server.dvtcli("-n", "1", "map", "tpdo1", "606C", "--type", "255", "--inhibit", "20")
    assert ran.returncode == 0, ran.stderr
    assert server.dvtcli("-n", "1", "nmt", "start").returncode == 0
    return bus


def write(bus: can.BusABC, index: int, data: bytes) -> None:
    """An SDO download to node 1, and its acknowledgement."""
    place = index.to_bytes(2, "little") + b"\0"
    request = bytes([0x23 | 4 - len(data) << 2]) + place + data.ljust(4, b"\0")
    bus.send(can.Message(arbitration_id=0x601, data=request, is_extended_id=False))
    first(bus, lambda frame: frame.arbitration_id == 0x581 and bytes(frame.data[:4]) == b"\x60" + place)


def test_a_signal_is_seen_by_whoever_listens(tmp_path: Path) -> None:
    with served(tmp_path, "gen4@1", "--signal", "606C=sine(1500,1s)") as server:
        bus = with_velocity_on_tpdo1(server)
        seen = velocities(bus, lambda seen: bool(seen) and max(seen) > 1200 and min(seen) < -1200)
        assert all(-1500 <= value <= 1500 for value in seen)


def test_a_target_velocity_moves_a_served_drive(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1") as server:
        bus = with_velocity_on_tpdo1(server)
        write(bus, 0x60FF, (300).to_bytes(4, "little"))
        for controlword in (6, 7, 15):
            write(bus, 0x6040, controlword.to_bytes(2, "little"))
        seen = velocities(bus, lambda seen: bool(seen) and seen[-1] == 300)
        assert seen == sorted(seen)
        write(bus, 0x6040, b"\x02\x00")  # quick stop
        assert velocities(bus, lambda seen: bool(seen) and seen[-1] == 0)[0] <= 300


def test_wrong_signals_end_before_anything_listens() -> None:
    ran = dvtcli("sim", "gen4@1", "--signal", "606C=sine(1)")
    assert (ran.returncode, ran.stdout) == (2, "")
    assert "write sine(AMPLITUDE,PERIOD)" in ran.stderr


def test_a_producer_that_falls_silent_is_an_emergency_and_ends_operation(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1") as server:
        bus = server.attach()
        assert server.dvtcli("-n", "1", "write", "1016:1", "0x007E0064").returncode == 0
        assert server.dvtcli("-n", "1", "nmt", "start").returncode == 0
        bus.send(can.Message(arbitration_id=0x77E, data=b"\x05", is_extended_id=False))
        lost = first(bus, lambda frame: frame.arbitration_id == 0x081)
        assert bytes(lost.data[:3]) == b"\x30\x81\x11"
        first(bus, lambda frame: frame.arbitration_id == 0x701 and frame.data[0] == 0x7F)
        bus.send(can.Message(arbitration_id=0x77E, data=b"\x05", is_extended_id=False))
        assert bytes(first(bus, lambda frame: frame.arbitration_id == 0x081).data) == bytes(8)
