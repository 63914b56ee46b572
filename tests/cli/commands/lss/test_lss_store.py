"""`lss store`: a node-ID is stored, and proved by a reset."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import UNCONFIGURED
from tests.cli.commands.lss.lss_bench import bench, power_cycle
from tests.lss_nodes import unconfigured

pytestmark = pytest.mark.drawn(14, "lss")


def test_a_store_that_fails_is_none() -> None:
    device = unconfigured(1, node_id=3)
    device.areas.fails = True
    with bench(device) as session:
        ran = session.run("lss store 3")
        ran.failed(1, "storage medium failed")


def test_who_waits_for_another_node_id_stores_the_one_it_has() -> None:
    """A dvtcli that was killed on the way left a node-ID that the next reset would bring."""
    device = unconfigured(1, node_id=3)
    device.lss.pending = 9
    with bench(device) as session:
        assert session.run("lss store 3").code == 0
    assert power_cycle(device) == [3]


def test_a_store_is_proved_by_a_reset() -> None:
    device, liar = unconfigured(1, node_id=3), unconfigured(2, node_id=4)
    liar.areas.stores_nothing = True
    liar.lss.stored = UNCONFIGURED
    with bench(device, liar) as session:
        assert session.run("lss store 3 --prove --json").document["nodes"][0]["proved"]
        assert "proved by a reset" in session.run("lss store 3 --prove").stdout
        ran = session.run("lss store 4 --prove")
        ran.failed(7, "its node-ID is none now")
