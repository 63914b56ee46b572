"""`lss node-id` and `lss select`: a node gets a node-ID that is seen on the bus."""

from __future__ import annotations

from contextlib import suppress

import pytest

from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.ports import Frame
from dvtcli.operations.lss.lss_node_id import lss_node_id
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from tests.cli.commands.bench import Bench
from tests.cli.commands.lss.lss_bench import bench, sent
from tests.lss_nodes import address_of, unconfigured
from tests.virtual_time import VirtualTimeBus

pytestmark = pytest.mark.drawn(14, "lss")


@pytest.mark.parametrize("family", ["generic", "lss-echo", "lss-reset", "no-boot-up"])
@pytest.mark.parametrize("others", [0, 1])
def test_every_family_gets_its_first_node_id_and_another_one(family: str, others: int) -> None:
    """Also who comes up by a reset only, or without saying so; nobody else without a node-ID gets one."""
    device = unconfigured(0xC0FFEE, family)
    rest = [unconfigured(2 + number, family) for number in range(others)]
    with bench(device, *rest) as session:
        for node_id, before in ((5, None), (9, 5)):
            ran = session.run(f"lss node-id {node_id} {address_of(device)} --json")
            assert ran.code == 0, ran.stderr
            (row,) = ran.document["nodes"]
            assert (row["before"], row["node"], device.node_id) == (before, node_id, node_id)
        assert all((other.node_id, other.lss.pending) == (UNCONFIGURED, UNCONFIGURED) for other in rest)


def test_what_is_selected_gets_the_node_id() -> None:
    nodes = [unconfigured(1), unconfigured(2)]
    with bench(*nodes) as session:
        assert "no node is selected" in session.run("lss node-id 9").stderr
        assert session.run(f"lss select {address_of(nodes[1])}").code == 0
        assert session.run("lss node-id 9").code == 0
        assert [device.node_id for device in nodes] == [UNCONFIGURED, 9]
        assert session.run("lss identify --json").document["without_node_id"] == 1


def test_another_node_id_counts_after_a_reset_of_communication() -> None:
    device = unconfigured(7, node_id=3)
    with bench(device) as session:
        told = session.run(f"lss node-id 9 {address_of(device)} --json").document
        assert (told["nodes"][0]["before"], device.node_id) == (3, 9)
        again = session.run(f"lss node-id 9 {address_of(device)} --json").document
        assert again["nodes"][0]["before"] == 9


@pytest.mark.parametrize("heartbeat_ms", [0, 100])
def test_a_node_id_in_use_is_refused(heartbeat_ms: int) -> None:
    device, other = unconfigured(1), unconfigured(2, node_id=5)
    other.set_value(0x1017, 0, heartbeat_ms.to_bytes(2, "little"))
    with bench(device, other) as session:
        ran = session.run(f"lss node-id 5 {address_of(device)}")
        assert (ran.code, device.lss.pending) == (6, UNCONFIGURED)
        assert "node-ID 5 is in use" in ran.stderr


def test_who_is_selected_by_its_node_id_gets_another_one() -> None:
    device = unconfigured(7, node_id=3)
    with bench(device, unconfigured(8)) as session:
        found = session.run("lss select 3 --json").document["nodes"]
        assert [(row["serial"], row["node"]) for row in found] == [(7, 3)]
        assert (session.run("lss node-id 9").code, device.node_id) == (0, 9)
        ran = session.run("lss select 44")
        ran.failed(5, "node 44 does not answer")


class Cut(Exception):
    """The power of the computer fails."""


@pytest.mark.parametrize("before", [3, UNCONFIGURED])
def test_what_is_killed_on_the_way_stores_nothing_and_is_finished_by_the_same_words(before: int) -> None:
    line = f"lss node-id 5 {address_of(unconfigured(1))}"
    for killed_after in range(1, 30):
        device = unconfigured(1, node_id=before)
        bus = VirtualTimeBus([device], simulated=False)
        frames = sent(bus)

        def cut(_frame: Frame, ours: bool, frames: list[Frame] = frames, after: int = killed_after) -> None:
            if ours and len(frames) == after:
                raise Cut

        stop = bus.tap(cut)
        with suppress(Cut), Session(Options(yes=True), open_bus=lambda _options, bus=bus: bus) as session:
            lss_node_id(session, 5, address_of(device))
            return  # it was done before
        stop()
        assert device.lss.stored == before
        with Bench((), {"yes": True}, VirtualTimeBus([device], simulated=False)) as session:
            ran = session.run(line)
            assert (ran.code, device.node_id, device.lss.stored) == (0, 5, before), (killed_after, ran.stderr)
