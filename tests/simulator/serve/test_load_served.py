"""The load that is computed, and what is on a bus that is served over TCP at a bit rate: they agree.

SYNC paces the frames, and its period is the one that was said: what a slow machine takes for it changes no count.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import can
import pytest

import dvtcli
from dvtcli.domain.ports import Frame
from dvtcli.operations.results.networks import Measured
from dvtcli.watch.statistics import FrameCount
from tests.harness.sample import heavy
from tests.process import PATIENCE_S
from tests.simulator.serve.served import ANSWER_S, Served, served

BIT_RATE, SYNC_MS, SYNCS = 125_000, 10, 120


def _set_up(bus: dvtcli.Bus) -> None:
    """Every SYNC a frame of node 1; every second and every third one a frame of node 5."""
    drive, io = bus.node(1), bus.node(5)
    drive.map("tpdo1", "6041", "606C", sync=1)
    drive.disable("tpdo2")
    io.map("tpdo1", "6041", "6000:01", sync=2)
    io.map("tpdo2", "6401:01", "6401:02", sync=3)
    for node in (drive, io):
        node.write("1017", 0, "u16")


def _received(server: Served) -> FrameCount:
    """What passes while SYNC is sent, each once the node answered the one before."""
    count, bus = FrameCount(), server.attach()
    for _ in range(SYNCS):
        bus.send(can.Message(arbitration_id=0x080, is_extended_id=False))
        count.add(Frame(0x080, b""))
        while (message := bus.recv(PATIENCE_S)) is not None:
            if message.arbitration_id != 0x080:  # what one sends comes back from the server
                count.add(Frame(message.arbitration_id, bytes(message.data)))
            if message.arbitration_id == 0x181:
                break
    while count.by_id[0x285, False].frames < SYNCS // 3 and (message := bus.recv(PATIENCE_S)) is not None:
        count.add(Frame(message.arbitration_id, bytes(message.data)))  # of the last SYNC
    return count


@heavy
def test_what_is_on_a_served_bus_is_what_is_computed(tmp_path: Path) -> None:
    with (
        served(tmp_path, "gen4@1", "generic@5", "-b", str(BIT_RATE)) as server,
        dvtcli.connect(
            interface="socketcand", channel="can0", timeout_s=float(ANSWER_S), host="127.0.0.1", port=server.port
        ) as bus,
    ):
        _set_up(bus)
        computed = bus.load(for_s=0, bit_rate=BIT_RATE, sync_ms=SYNC_MS)
        for node_id in (1, 5):
            bus.node(node_id).nmt("start")
        received = _received(server)
    measured = Measured(received, SYNCS * SYNC_MS / 1000)
    both = replace(computed, measured=measured)
    assert both.expected is not None
    assert measured.load(BIT_RATE) == pytest.approx(both.expected, rel=0.02)
    assert measured.load(BIT_RATE) > 0.1
    assert not both.too_often
    rates = {one.identifier[0]: measured.rate_hz(one.identifier) for one in both.frames if one.heard}
    assert rates == pytest.approx({0x080: 100, 0x181: 100, 0x185: 50, 0x285: 100 / 3}, rel=0.02)
    assert computed.need.total is not None
    assert measured.load(BIT_RATE) <= computed.need.total
