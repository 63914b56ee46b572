"""A network as the example writes it, of a few nodes: planned, applied, planned again; a fault takes all back."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError, LeftChanged
from dvtcli.operations.changes.recover_change import recover
from dvtcli.simulator.network.station import SimulatedNode
from examples.many_nodes import network
from tests.harness.sample import heavy, part, turn
from tests.operations.network.bench import Chain, Heard
from tests.operations.network.killed import afterwards
from tests.operations.network.test_network_faults import FAULTS
from tests.surroundings import HOMES
from tests.virtual_time import VirtualTimeBus


class Unheard(Heard):
    """A bus that does not look at what RPDOs hear: on a large one that takes longer than all else.

    It calls *on_write* after each SDO download that a node took, with the number of those so far.
    """

    on_write: Callable[[int], None] = staticmethod(lambda _count: None)
    writes = 0

    def send_sdo(self, can_id: int, data: bytes) -> None:
        super().send_sdo(can_id, data)
        if data[0] >> 5 == 1:
            self.writes += 1
            self.on_write(self.writes)

    def _deliver(self, frame: Frame, sender: SimulatedNode | None) -> None:
        VirtualTimeBus._deliver(self, frame, sender)


def many(
    folder: Path, count: int, faults: list[str] | None = None, *, bus: type[Unheard] = Unheard, store: bool = False
) -> tuple[Chain, Path]:
    """*count* nodes, none of which is OPERATIONAL, and the file about them."""
    families = dict.fromkeys(range(1, count + 1), "generic")
    (folder / "files").mkdir()
    file = folder / "many.yaml"
    file.write_text(network(count) if store else network(count).replace("{store: true}", "{}"))
    return Chain(folder / "files", faults, operational=False, families=families, bus=bus), file


def written(chain: Chain) -> int:
    """How many SDO downloads its nodes took so far."""
    assert isinstance(chain.bus, Unheard)
    return chain.bus.writes


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "home").mkdir()
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))


@heavy
def test_a_plan_for_many_nodes_is_empty_once_it_was_applied(tmp_path: Path) -> None:
    chain, file = many(tmp_path, 4)
    assert chain.plan(file).plan.writes == 36 * 4
    assert chain.apply(file)
    assert not chain.plan(file).plan.changed
    assert chain.apply(file).plan.writes == 0
    assert chain.journals() == []


@pytest.mark.counted
def test_a_large_network_is_planned_applied_and_empty(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    count = pytestconfig.getoption("--nodes")
    chain, file = many(tmp_path, count)
    assert chain.apply(file).plan.writes == written(chain) == 36 * count
    assert chain.apply(file).plan.writes == 0
    assert written(chain) == 36 * count, "the second one writes nothing at all"
    assert chain.journals() == []


@pytest.mark.counted
@pytest.mark.drawn(1)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_one_of_a_large_network_takes_all_of_them_back(
    tmp_path: Path, pytestconfig: pytest.Config, fault: str
) -> None:
    count = pytestconfig.getoption("--nodes")
    drawn = random.Random(f"{turn(pytestconfig)} {fault}")
    node_id, step = drawn.randint(1, count), drawn.randint(1, 36)
    chain, file = many(tmp_path, count, [f"{node_id}:{fault.format(step)}"])
    before = chain.held()
    try:
        chain.apply(file)
    except DvtcliError as failed:
        raised = failed
    else:  # the device refuses it while the PDO is enabled, and takes it when the PDO is off
        assert "0x06090030" in fault, (fault, node_id, step)
        assert chain.plan(file).plan.writes == 0
        return
    dead = {node_id} if isinstance(raised, LeftChanged) else set[int]()
    assert bool(dead) == ("silent" in fault), (fault, node_id, step, raised, raised.why)
    held = chain.held()
    assert {one for one in held if held[one] != before[one]} <= dead, (fault, node_id, step)
    assert len(chain.journals()) == len(dead)


@pytest.mark.counted
def test_a_large_network_is_recovered_wherever_it_was_killed(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    count, home = pytestconfig.getoption("--nodes"), tmp_path / "home"
    chain, file = many(tmp_path, count, store=True)
    before = chain.held()
    kills = pytestconfig.getoption("--kills")
    chosen = part(range(1, 37 * count + 1), kills, pytestconfig, "many nodes")
    wrong: dict[int, str] = {}

    def look(after: Chain) -> None:
        with after.session(node=None) as session:
            recover(session)
        assert (after.held(), after.journals()) == (before, [])

    def on_write(number: int) -> None:
        if number in chosen and (failed := afterwards(chain, home, look)):
            wrong[number] = failed

    chain.bus.on_write = on_write  # type: ignore[attr-defined]
    chain.apply(file)
    assert wrong == {}
    assert written(chain) == 37 * count, "what changes, and a store a node"
