"""Branches that the tests in their own process took, per room: `python -m tests.house.branches FOLDER [FILE…]`.

FOLDER is that of `pytest --branches FOLDER`; of each FILE (`device/node.py`) it names the lines and branches that
nobody took. A test that runs dvtcli as a process of its own counts nothing here. Knows no bound: the numbers are there
to be read.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import slipcover

from tests.branches import PACKAGE
from tests.house.draw import ROOMS, room_of

_KEYS = ("executed_branches", "missing_branches", "executed_lines", "missing_lines")


def counted(folder: Path) -> dict[str, Any]:
    """What all processes counted, by the file's place in the package; also files that nobody imported."""
    whole = slipcover.Slipcover(branch=True, source=[str(PACKAGE)]).get_coverage()
    for one in sorted(folder.glob("*.json")):
        slipcover.merge_coverage(whole, json.loads(one.read_text("utf-8")))
    return {Path(path).resolve().relative_to(PACKAGE).as_posix(): found for path, found in whole["files"].items()}


def rooms(files: dict[str, Any]) -> Iterator[str]:
    """A line for each room in the house's order, and one for all: its branches, and its lines."""
    counts: dict[str, list[int]] = defaultdict(lambda: [0] * len(_KEYS))
    for path, found in files.items():
        for name in (room_of(path), "all"):
            counts[name] = [sum(pair) for pair in zip(counts[name], (len(found[key]) for key in _KEYS), strict=True)]
    if not counts["all"][0]:
        yield "nothing was counted: there is nothing in this folder"
        return
    yield f"{'room':<12}{'branches':>20}{'lines':>20}"
    for name in (*ROOMS, "all"):
        if any(counts[name]):
            gone, left, run, not_run = counts[name]
            yield f"{name:<12}{_share(gone, left):>20}{_share(run, not_run):>20}"


def _share(part: int, rest: int) -> str:
    whole = part + rest
    return f"{part}/{whole} {100 * part / whole:5.1f} %" if whole else "-"


def left(found: dict[str, Any], file: str) -> Iterator[str]:
    """The lines of *file* that nobody ran, and the branches from line to line that nobody took."""
    yield from (f"{file}:{line}" for line in found["missing_lines"])
    yield from (f"{file}:{here} to {there}" for here, there in found["missing_branches"])


if __name__ == "__main__":
    seen = counted(Path(sys.argv[1]))
    lines = [line for file in sys.argv[2:] for line in left(seen[file], file)] if sys.argv[2:] else rooms(seen)
    sys.stdout.writelines(f"{line}\n" for line in lines)
