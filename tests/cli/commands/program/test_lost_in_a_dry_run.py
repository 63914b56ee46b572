"""A bus that is lost in a dry run, wherever that is: nothing was written, and no node is left changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.program.test_lost_behind_acts import CutBus
from tests.harness.sample import part


def lost(line: str, left: int, *, dry_run: bool) -> tuple[CutBus, Ran]:
    """What *line* ends with on a bus that is lost behind that many frames of ours, never with 0; and that bus."""
    bus = CutBus([simulated_device(one) for one in simulated_nodes(["generic@1", "generic@3"])], simulated=False)
    with Bench((), {"yes": True, "dry_run": dry_run}, bus) as bench:
        bus.left = left
        return bus, bench.run(f"{line} --json")


def told(ran: Ran) -> tuple[int, str, str]:
    """Its exit code, and which error and state it names."""
    error: dict[str, Any] = next(one for one in ran.documents if one["schema"] == "dvtcli.error/1")
    return ran.code, error["error"], error["state"]


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "x.dvt"
    path.write_text("set 1:tpdo1 --timer 61\nset 3:tpdo1 --timer 62\n")
    return path


@pytest.mark.counted
@pytest.mark.parametrize(
    "line", ["map 1:tpdo1 1001", "disable 3:tpdo1 3:rpdo1", "link 1:tpdo1 3:rpdo1", "run {script} --atomic"]
)
def test_it_is_the_bus_that_is_wrong_and_nothing_is_changed(
    line: str, script: Path, pytestconfig: pytest.Config
) -> None:
    """Behind the first frame and the last but one, and behind twice as many others by lot as `--answers` says."""
    words = line.format(script=script)
    bus, ran = lost(words, 0, dry_run=True)
    assert ran.code == 0, ran
    frames = range(1, -bus.left)
    assert len(frames) > 60
    chosen = part(frames, 2 * pytestconfig.getoption("--answers"), pytestconfig, line)
    for left in (frames[0], *chosen, frames[-1]):
        assert told(lost(words, left, dry_run=True)[1]) == (5, "bus", "unchanged"), left


def test_an_atomic_script_that_had_changed_nothing_takes_nothing_back(script: Path) -> None:
    assert told(lost(f"run {script} --atomic", 1, dry_run=False)[1]) == (5, "bus", "unchanged")
