"""A transmit queue that is full again and again in the middle of an `apply` is waited for: the same end as without.

The driver is python-can's virtual bus with a queue that takes some frames only after some tries, as SocketCAN says it.
"""

from __future__ import annotations

import errno
from pathlib import Path

import can
import pytest
from can.interfaces.virtual import VirtualBus

from dvtcli.bus.python_can import CanBus
from dvtcli.operations.network.network_files import applied
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import device
from tests.served_nodes import ServedNodes
from tests.surroundings import HOMES

FILE = "defaults: {tpdo: {1: {event_timer: 40}}}\nnodes: {a: {node_id: 1}, b: {node_id: 3}}\n"
_EVERY, _TRIES = 5, 3


class OftenFull(VirtualBus):
    """Takes each fifth frame only after three tries."""

    taken = refused = left = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.left:
            self.left -= 1
            self.refused += 1
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        super().send(msg, timeout)
        self.taken += 1
        self.left = 0 if self.taken % _EVERY else _TRIES


def test_a_queue_that_is_full_in_the_middle_of_an_apply_is_a_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))
    channel = f"often-full-{tmp_path}"
    devices = [device(1), device(3)]
    file, folder = tmp_path / "net.yaml", tmp_path / "files"
    file.write_text(FILE)
    driver = OftenFull(channel)
    options = Options(yes=True, force=True, journal=str(folder))  # force: another master is not listened for
    with (
        can.Bus(channel, interface="virtual", ignore_config=True) as other,
        ServedNodes(other, devices),
        Session(options, open_bus=lambda _: CanBus(driver, f"virtual:{channel}", timeout_s=20.0)) as session,
    ):
        for one in devices:
            session.open_network().files.own_eds[one.node_id] = family_eds("generic")
            session.open_network().files.own_profile[one.node_id] = "generic"
        before = driver.refused
        done = applied(session, str(file))
    assert done.plan.writes >= 2
    assert driver.refused - before > 10 * _TRIES
    assert [one.value(0x1800, 5) for one in devices] == [(40).to_bytes(2, "little")] * 2
    assert not list(folder.rglob("journals/*.json"))
