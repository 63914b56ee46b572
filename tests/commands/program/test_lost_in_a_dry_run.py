"""A bus that is lost in a dry run, wherever that is: nothing was written, and no node is left changed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dvtcli.operations.opening.simulated_nodes import simulated_device, simulated_nodes
from tests.commands.bench import Bench
from tests.commands.program.test_lost_behind_acts import CutBus

#: every so many frames the bus is lost, and so each line is tried at most about a hundred times
STEP = 3


def lost_everywhere(line: str, *, dry_run: bool) -> Iterator[tuple[int, dict[str, Any]]]:
    """The exit code of *line* and its error, on a bus that is lost behind the first frame, a later one, …"""
    for left in range(1, 2000, STEP):
        bus = CutBus([simulated_device(one) for one in simulated_nodes(["generic@1", "generic@3"])], simulated=False)
        with Bench((), {"yes": True, "dry_run": dry_run}, bus) as bench:
            bus.left = left
            ran = bench.run(f"{line} --json")
            if not bus.cut:
                assert ran.code == 0, ran
                return
            yield ran.code, next(one for one in ran.documents if one["schema"] == "dvtcli.error/1")


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "x.dvt"
    path.write_text("set 1:tpdo1 --timer 61\nset 3:tpdo1 --timer 62\n")
    return path


@pytest.mark.parametrize(
    "line", ["map 1:tpdo1 1001", "disable 3:tpdo1 3:rpdo1", "link 1:tpdo1 3:rpdo1", "run {script} --atomic"]
)
def test_it_is_the_bus_that_is_wrong_and_nothing_is_changed(line: str, script: Path) -> None:
    lost = list(lost_everywhere(line.format(script=script), dry_run=True))
    assert len(lost) > 20
    assert {(code, error["error"], error["state"]) for code, error in lost} == {(5, "bus", "unchanged")}


def test_an_atomic_script_that_had_changed_nothing_takes_nothing_back(script: Path) -> None:
    first = next(lost_everywhere(f"run {script} --atomic", dry_run=False))
    assert (first[0], first[1]["state"]) == (5, "unchanged")
