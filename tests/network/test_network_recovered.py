"""`recover` and `undo --all` over three nodes: phase by phase, no RPDO hears a layout that it is not mapped for."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.operations.recover_change import recover
from tests.network.bench import Chain
from tests.network.killed import Watched, afterwards
from tests.network.test_network_faults import OPERATIONAL, STEPS, ideal
from tests.sample import part


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for folder in ("ideal", "home"):
        for name in ("HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME"):
            monkeypatch.setenv(name, str(tmp_path / folder))
        ideal()
    return tmp_path / "home"


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
