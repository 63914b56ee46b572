"""A network as the example writes it, of a few nodes: planned, applied, planned again; a fault takes all back."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.errors import DvtcliError, LeftChanged
from dvtcli.simulator.network.station import SimulatedNode
from examples.many_nodes import network
from tests.network.bench import Chain, Heard
from tests.network.test_network_faults import FAULTS
from tests.sample import turn
from tests.virtual_time import VirtualTimeBus


class Unheard(Heard):
    """A bus that does not look at what RPDOs hear: on a large one that takes longer than all else."""

    def _deliver(self, frame: Frame, sender: SimulatedNode | None) -> None:
        VirtualTimeBus._deliver(self, frame, sender)


def many(
    folder: Path, count: int, faults: list[str] | None = None, *, bus: type[Heard] = Unheard
) -> tuple[Chain, Path]:
    """*count* nodes, none of which is OPERATIONAL, and the file about them."""
    families = dict.fromkeys(range(1, count + 1), "generic")
    (folder / "files").mkdir()
    file = folder / "many.yaml"
    file.write_text(network(count).replace("{store: true}", "{}"))
    return Chain(folder / "files", faults, operational=False, families=families, bus=bus), file


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))


def test_a_plan_for_many_nodes_is_empty_once_it_was_applied(tmp_path: Path) -> None:
    chain, file = many(tmp_path, 4)
    assert chain.plan(file).plan.writes == 36 * 4
    assert chain.apply(file)
    assert not chain.plan(file).plan.changed
    assert chain.apply(file).plan.writes == 0
    assert chain.journals() == []


@pytest.mark.counted
def test_a_fault_in_one_of_them_takes_all_of_them_back(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    drawn = random.Random(turn(pytestconfig))
    fault, node_id, step = drawn.choice(FAULTS), drawn.randint(1, 6), drawn.randint(1, 36)
    chain, file = many(tmp_path, 6, [f"{node_id}:{fault.format(step)}"])
    before = chain.held()
    with pytest.raises(DvtcliError) as raised:
        chain.apply(file)
    dead = {node_id} if isinstance(raised.value, LeftChanged) else set[int]()
    assert bool(dead) == ("silent" in fault), (fault, node_id, step, raised.value, raised.value.why)
    held = chain.held()
    assert {one for one in held if held[one] != before[one]} <= dead, (fault, node_id, step)
    assert len(chain.journals()) == len(dead)
