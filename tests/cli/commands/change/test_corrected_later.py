"""A device that takes a value and goes back to the old one after the read-back: the one thing that none can see."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from dvtcli.simulator.device.simulated_faults import Fault
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import device
from tests.virtual_time import VirtualTimeBus

CORRECTED_S = 0.05
TIMER = (0x1800, 5)


@pytest.fixture
def bus() -> VirtualTimeBus:
    return VirtualTimeBus([device("generic")], faults=[Fault.parse(f"corrects@1={CORRECTED_S}")], simulated=False)


@pytest.fixture
def bench(bus: VirtualTimeBus) -> Iterator[Bench]:
    """A session whose change was read back equal, and corrected since."""
    with Bench((), {"node": 1}, bus) as bench:
        ran = bench.run("set tpdo1 --timer 70")
        assert (ran.code, "read back equal" in ran.stderr + ran.stdout) == (0, True)
        assert bus.nodes[0].device.value(*TIMER) == b"\x46\0", "what was said is what was read"
        bus.sleep(CORRECTED_S)
        assert bus.nodes[0].device.value(*TIMER) == b"\0\0"
        yield bench


def test_verify_finds_it(bench: Bench) -> None:
    ran = bench.run("verify --json")
    assert (ran.code, ran.document["equal"]) == (3, False)
    assert "event timer is 0, expected 70" in ran.stdout


def test_a_store_finds_it_and_stores_nothing(bench: Bench, bus: VirtualTimeBus) -> None:
    ran = bench.run("store")
    ran.failed(6, "TPDO1: event timer is 0, expected 70")
    assert bench.run("verify").code == 3
    bus.nodes[0].device.set_value(*TIMER, b"\x46\0")
    assert [bench.run(line).code for line in ("verify", "store")] == [0, 0]


def test_an_undo_has_nothing_to_put_back(bench: Bench) -> None:
    ran = bench.run("undo")
    assert (ran.code, "nothing" in ran.stdout + ran.stderr) == (0, True), ran
