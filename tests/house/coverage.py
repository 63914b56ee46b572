"""Branches that the tests in their own process went, per room: `python -m tests.house.coverage` after `pytest --cov`.

A test that runs dvtcli as a process of its own counts nothing here. Knows no bound: the numbers are there to be read.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from coverage import Coverage

from tests.house.draw import ROOMS, room_of


def report() -> dict[str, Any]:
    """What coverage's data in this folder say, as its JSON report."""
    measured = Coverage()
    measured.load()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "report.json"
        measured.json_report(outfile=str(file))
        found: dict[str, Any] = json.loads(file.read_text("utf-8"))
    return found


def rooms(found: dict[str, Any]) -> Iterator[str]:
    """A line for each room in the house's order, and one for all."""
    counts: dict[str, list[int]] = defaultdict(lambda: [0] * 4)
    for path, file in found["files"].items():
        room = room_of(path.replace("\\", "/").partition("dvtcli/")[2])
        for name in (room, "all"):
            for number, key in enumerate(_KEYS):
                counts[name][number] += file["summary"].get(key, 0)  # no branches: they were not counted
    if not counts["all"][2]:
        yield "nothing was counted: the data in this folder are empty"
        return
    yield f"{'room':<12}{'branches':>20}{'lines':>20}"
    for name in (*ROOMS, "all"):
        if any(counts[name]):
            gone, branches, run, lines = counts[name]
            yield f"{name:<12}{_share(gone, branches):>20}{_share(run, lines):>20}"


_KEYS = ("covered_branches", "num_branches", "covered_lines", "num_statements")


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole} {100 * part / whole:5.1f} %" if whole else "-"


if __name__ == "__main__":
    sys.stdout.writelines(f"{line}\n" for line in rooms(report()))
