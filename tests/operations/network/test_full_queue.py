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
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import BusUnavailable, LeftChanged
from dvtcli.operations.changes.change import configure
from dvtcli.operations.network.network_files import apply_file
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import device
from tests.harness.sample import heavy
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


@heavy
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
        done = apply_file(session, str(file))
    assert done.plan.writes >= 2
    assert driver.refused - before > 10 * _TRIES
    assert [one.value(0x1800, 5) for one in devices] == [(40).to_bytes(2, "little")] * 2
    assert not list(folder.rglob("journals/*.json"))


class FullFromFirstWrite(VirtualBus):
    """Takes every frame up to the first SDO download, and none from there on; *takes_one*: that one is taken."""

    takes_one = False
    is_full = False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        writes = 0x600 < msg.arbitration_id < 0x680 and msg.data[0] >> 5 == 1
        if self.is_full or (writes and not self.takes_one):
            self.is_full = True
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        self.is_full = writes
        super().send(msg, timeout)


@pytest.mark.parametrize("takes_one", [False, True])
def test_a_first_write_that_never_left_this_computer_left_the_node_unchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, takes_one: bool
) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))
    channel = f"full-from-first-write-{tmp_path}"
    node, folder = device(1), tmp_path / "files"
    driver = FullFromFirstWrite(channel)
    driver.takes_one = takes_one
    options = Options(yes=True, force=True, journal=str(folder))
    with (
        can.Bus(channel, interface="virtual", ignore_config=True) as other,
        ServedNodes(other, [node]),
        Session(options, open_bus=lambda _: CanBus(driver, f"virtual:{channel}", timeout_s=20.0)) as session,
    ):
        session.open_network().files.own_eds[1] = family_eds("generic")
        session.open_network().files.own_profile[1] = "generic"
        before = node.value(0x1800, 5)
        asked = PdoRequest(event_timer=40)
        with pytest.raises(LeftChanged if takes_one else BusUnavailable) as failed:
            configure(session, session.node(1), {Pdo.parse("tpdo1"): asked})
        assert failed.value.state == ("left_changed" if takes_one else "unchanged")
    assert (node.value(0x1800, 5) == before) is not takes_one
    assert bool(list(folder.rglob("journals/*.json"))) is takes_one
