"""Ways that the tests in their own process went, per room: `python -m tests.harness.branch_report FOLDER [FILE…]`.

FOLDER is that of `pytest --branches FOLDER`; of each FILE (`device/node.py`) it names the ways that nobody went. A test
that runs dvtcli as a process of its own counts nothing here. Knows no bound: the numbers are there to be read.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.harness.branches import PACKAGE, Way, marked
from tests.house.draw import ROOMS, room_of


def gone(folder: Path) -> dict[str, set[int]]:
    """What any process went, by file."""
    found: dict[str, set[int]] = defaultdict(set)
    for one in folder.glob("*.json"):
        for file, numbers in json.loads(one.read_text("utf-8")).items():
            found[file] |= {*numbers}
    return found


@cache
def runners() -> dict[str, list[Way]]:
    """All ways of the product, by file, also of files that nobody imported."""
    files = sorted(PACKAGE.rglob("*.py"))
    return {path.relative_to(PACKAGE).as_posix(): marked(path.read_bytes(), str(path))[1] for path in files}


def rooms(went: dict[str, set[int]]) -> Iterator[str]:
    """A line for each room in the house's order, and one for all: its branches, and its functions."""
    if not any(went.values()):
        yield "nothing was counted: there is nothing in this folder"
        return
    counts: dict[str, list[int]] = defaultdict(lambda: [0] * 4)
    for file, there in runners().items():
        for number, way in enumerate(there):
            for name in (room_of(file), "all"):
                column = 2 * (way.kind == "def")
                counts[name][column] += number in went.get(file, ())
                counts[name][column + 1] += 1
    yield f"{'room':<12}{'branches':>20}{'functions':>20}"
    for name in (*ROOMS, "all"):
        if any(counts[name]):
            branches, of, called, functions = counts[name]
            yield f"{name:<12}{_share(branches, of):>20}{_share(called, functions):>20}"


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole} {100 * part / whole:5.1f} %" if whole else "-"


def left(went: dict[str, set[int]], file: str) -> Iterator[str]:
    """The ways of *file* that nobody went."""
    missing = [way for number, way in enumerate(runners()[file]) if number not in went.get(file, ())]
    yield from (f"{file}:{way.line} {way.kind}" for way in missing)


if __name__ == "__main__":
    seen = gone(Path(sys.argv[1]))
    lines = [line for file in sys.argv[2:] for line in left(seen, file)] if sys.argv[2:] else rooms(seen)
    sys.stdout.writelines(f"{line}\n" for line in lines)
