"""`recover` and `undo --all` over three nodes: phase by phase, no RPDO hears a layout that it is not mapped for."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path

import pytest

from dvtcli.errors import DvtcliError
from dvtcli.operations.changes.recover_change import recover
from dvtcli.operations.changes.undo import undo
from tests.harness.sample import heavy, part
from tests.operations.network.bench import Chain, Heard
from tests.operations.network.killed import Watched, afterwards
from tests.operations.network.test_network_faults import OPERATIONAL, STEPS, ideal


@pytest.mark.counted
def test_a_network_is_recovered_whenever_apply_was_killed(home: Path, pytestconfig: pytest.Config) -> None:
    """At every write, as many of them as `--kills` says."""
    chosen = part(range(1, len(STEPS) + 1), pytestconfig.getoption("--kills"), pytestconfig, "network")
    (home.parent / "files").mkdir()
    chain = Chain(home.parent / "files", bus=Watched)
    before, stored = chain.held(), chain.stored()

    def look(after: Chain) -> None:
        with after.session(node=None) as session:
            recover(session)
        after.wait(1.0)  # PDOs go on
        assert (after.held(), after.stored(), after.journals()) == (before, stored, [])
        assert after.states() == OPERATIONAL
        assert after.bus.layouts <= ideal()[1], "no RPDO heard a layout that it was not mapped for"

    wrong: dict[int, str] = {}

    def on_write(count: int) -> None:
        if count in chosen and (failed := afterwards(chain, home, look)):
            wrong[count] = failed

    chain.bus.on_write = on_write
    chain.apply()
    assert wrong == {}
    assert chain.bus.writes == len(STEPS)


@pytest.fixture
def applied(home: Path) -> Chain:
    """The network as its file says, by a process before this one."""
    (home.parent / "files").mkdir()
    return Chain(home.parent / "files", bus=Watched)


@heavy
def test_an_undo_of_all_nodes_goes_back_in_phases(applied: Chain) -> None:
    before, stored = applied.held(), applied.stored()
    applied.apply()
    with applied.session(node=None) as session:
        assert undo(session, everything=True)
    applied.wait(1.0)
    assert (applied.held(), applied.stored(), applied.journals()) == (before, stored, [])
    assert applied.states() == OPERATIONAL
    assert applied.bus.layouts <= ideal()[1], "no RPDO heard a layout that it was not mapped for"


@pytest.mark.counted
def test_an_undo_of_all_nodes_takes_all_of_them_back_or_none(home: Path, pytestconfig: pytest.Config) -> None:
    """A fault at a write of the way back, as many of them as `--kills` says."""
    cells = [(fault, *step) for step in STEPS for fault in ("refuse@{}=0x06090030", "reset@{}", "lose-response@{}")]
    for fault, node_id, step in part(cells, pytestconfig.getoption("--kills"), pytestconfig, "undo"):
        folder = home.parent / f"{fault[:4]}-{node_id}-{step}"
        folder.mkdir()
        # the way back takes about as many writes, and a fault behind its end is none; a node that restarts comes up
        # with what it has stored, and sends nothing until it is started
        noted = Heard if "reset" in fault else Watched
        chain = Chain(folder, [f"{node_id}:{fault.format(ideal()[0][node_id] + step)}"], bus=noted)
        before, stored = chain.held(), chain.stored()
        chain.apply()
        after, most = chain.held(), chain.downloads()[node_id]
        with suppress(DvtcliError), chain.session(node=None) as session:
            undo(session, everything=True)
        failed = chain.downloads()[node_id] >= ideal()[0][node_id] + step
        assert most == ideal()[0][node_id]
        assert chain.held() == (after if failed else before), (fault, node_id, step)
        assert (chain.stored(), chain.journals()) == (stored, [])
        assert chain.states() == OPERATIONAL
        assert chain.bus.layouts <= ideal()[1], (fault, node_id, step)
        shutil.rmtree(home)  # what is remembered of these nodes
