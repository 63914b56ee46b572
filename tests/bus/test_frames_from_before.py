"""Frames received before a bus is listened to are not counted, even if a background thread reads them late."""

from __future__ import annotations

import threading

import can
from can.interfaces.virtual import VirtualBus

from dvtcli.bus.python_can import CanBus
from dvtcli.domain.ports import Frame
from dvtcli.operations.network.live_network import received_traffic
from tests.cli.commands.bench import Bench

FRAMES = 20


def test_frames_that_a_busy_reader_has_not_read_yet_are_not_of_the_window(channel: str) -> None:
    """The thread that reads is held at the first frame until the bus is listened to."""
    bus, other = CanBus(VirtualBus(channel), "virtual"), VirtualBus(channel)
    is_held, goes_on = threading.Event(), threading.Event()

    def hold(frame: Frame, _sent: bool) -> None:
        if frame.can_id == 0x181 and not goes_on.is_set():
            is_held.set()
            goes_on.wait()

    end = bus.tap(hold)
    reader = threading.Thread(target=bus.idle, args=(2.0,))
    reader.start()
    for number in range(FRAMES):
        other.send(can.Message(arbitration_id=0x181, data=bytes([number]), is_extended_id=False))
    is_held.wait()
    release = threading.Timer(0.1, goes_on.set)
    with Bench((), {}, bus) as bench:
        bench.session.open_network()
        release.start()
        traffic = received_traffic(bench.session, 0.3)
    bus.close()
    reader.join()
    other.shutdown()
    end()
    assert traffic is not None
    assert traffic.count((0x181, False)) == 0
