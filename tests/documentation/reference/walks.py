"""The way of a command through the code: each function from the command's own to an SDO download or upload.

`python -m tests.documentation.reference.walks FILE END WITHIN WORDS…` runs one command and writes its walk as JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from dvtcli.cli.main import main
from tests.documentation.reference.markdown import code, table
from tests.house.source import PACKAGE
from tests.surroundings import ROOT, homes

_NODE = "  {name}:\n    node_id: {id}\n    tpdo:\n      3:\n        cob_id: 0x38{id}\n        mapping: [6041]\n"
_FILES = {
    "net.yaml": "nodes:\n" + _NODE.format(name="drive", id=1),
    "two.yaml": "nodes:\n" + _NODE.format(name="drive", id=1) + _NODE.format(name="pump", id=5),
}


class Walk(NamedTuple):
    """A command in *words*, and the SDO call that *end*s its walk: the first, or the first *within* functions `a,b`."""

    title: str
    words: tuple[str, ...]
    end: str = "download"
    within: str = ""


WALKS = (
    Walk("`map`, to the first SDO download", ("--sim", "gen4", "-y", "map", "tpdo3", "6041")),
    Walk("`store`, to the first SDO download", ("--sim", "gen4", "-y", "store")),
    Walk(
        "`store --prove`, to the download of the value that will test the reset",
        ("--sim", "gen4", "-y", "store", "--prove"),
        within="write",
    ),
    Walk(
        "`store --prove`, to the first upload of the comparison after the reset",
        ("--sim", "gen4", "-y", "store", "--prove"),
        "upload",
        "_restarted,pdos",
    ),
    Walk("`apply`, to the first SDO download", ("--sim", "gen4", "-y", "apply", "net.yaml")),
    Walk("`export`, to the first SDO upload", ("--sim", "gen4", "export", "x.dcf"), "upload"),
)
_REFUSED = "--fault", "1:refuse@3=0x08000000"
ROLL_BACKS = (
    Walk(
        "`map`, whose third download is refused, to the first download of the roll-back",
        ("--sim", "gen4", *_REFUSED, "-y", "map", "tpdo3", "6041"),
        within="_roll_back",
    ),
    Walk(
        "`apply` of two nodes, of which the second refuses, to the first download of the roll-back of the first",
        ("--sim", "gen4", "--sim", "gen4@5", "--fault", "5:refuse@2=0x08000000", "-y", "apply", "two.yaml"),
        within="roll_back",
    ),
)


def walks() -> Iterator[str]:
    """A table for each command: its functions from the command to the first request on the SDO channel."""
    return _tables(WALKS)


def roll_backs() -> Iterator[str]:
    """A table for each refused command: its functions from the command to the first write of the roll-back."""
    return _tables(ROLL_BACKS)


def _tables(shown: Iterable[Walk]) -> Iterator[str]:
    for each in shown:
        steps = walk(each)
        yield f"{each.title}: {len(steps)} functions."
        yield ""
        yield from table(("file", "function"), ((code(file), function) for file, function in steps))
        yield ""


def walk(of: Walk) -> list[tuple[str, str]]:
    """The (file, function) pairs that the command has entered when its walk ends."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / ".git").mkdir()
        for name, text in _FILES.items():
            (place / name).write_text(text, encoding="utf-8")
        kept = place / "walk.json"
        ran = subprocess.run(
            [sys.executable, "-m", "tests.documentation.reference.walks", str(kept), of.end, of.within, *of.words],
            cwd=place,
            env={"PATH": "", "PYTHONPATH": str(ROOT), **homes(place / "home")},
            capture_output=True,
            text=True,
            check=False,
        )
        if not kept.exists():
            raise AssertionError(f"dvtcli {' '.join(of.words)} called no {of.end}: {ran.stderr}")
        return [(file, function) for file, function in json.loads(kept.read_text("utf-8"))]


def _keep_walk(path: Path, end: str, within: str) -> None:
    """Write the functions that run at the first call of *end* in bus/sdo, or the first *within* others, to *path*."""

    def look(frame: FrameType, event: str, _argument: Any) -> None:
        at = frame.f_code
        if event != "call" or at.co_name != end or Path(at.co_filename).parent != PACKAGE / "bus" / "sdo":
            return
        steps = _ours(frame)
        if threading.current_thread() is not threading.main_thread():
            main_thread = threading.main_thread().ident
            steps = _ours(sys._current_frames()[main_thread or 0]) + steps
        entered = {function.rpartition(".")[2] for _, function in steps}
        if not entered.issuperset(filter(None, within.split(","))):
            return
        sys.setprofile(None)
        threading.setprofile(None)
        if path.exists():
            return
        first = steps.index(next(step for step in steps if step[1] == "command"))
        path.write_text(json.dumps(steps[first:]), encoding="utf-8")

    threading.setprofile(look)
    sys.setprofile(look)


def _ours(frame: FrameType | None) -> list[tuple[str, str]]:
    """The functions of the package that lead to *frame*, the outermost first."""
    steps: list[tuple[str, str]] = []
    while frame is not None:
        file = Path(frame.f_code.co_filename)
        if file.is_relative_to(PACKAGE):
            steps.append((file.relative_to(PACKAGE).as_posix(), frame.f_code.co_qualname.replace(".<locals>", "")))
        frame = frame.f_back
    return steps[::-1]


if __name__ == "__main__":
    _keep_walk(Path(sys.argv[1]), sys.argv[2], sys.argv[3])
    sys.argv = ["dvtcli", *sys.argv[4:]]
    main()
