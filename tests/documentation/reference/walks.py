"""The way of a command through the code: each function from the command's own to the first SDO download or upload.

`python -m tests.documentation.reference.walks FILE WORDS…` runs one command and prints its walk as JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from dvtcli.cli.main import main
from tests.documentation.reference.markdown import code, table
from tests.house.source import PACKAGE
from tests.surroundings import ROOT, homes

_NETWORK = "nodes:\n  drive:\n    node_id: 1\n    tpdo:\n      3:\n        cob_id: 0x381\n        mapping: [6041]\n"
#: the words of each command, and the call at which its walk ends
WALKS: dict[str, tuple[list[str], str]] = {
    "map": (["--sim", "gen4", "-y", "map", "tpdo3", "6041"], "download"),
    "store": (["--sim", "gen4", "-y", "store"], "download"),
    "apply": (["--sim", "gen4", "-y", "apply", "net.yaml"], "download"),
    "export": (["--sim", "gen4", "export", "x.dcf"], "upload"),
}


def walks() -> Iterator[str]:
    """A table for each command: its functions from the command to the first request on the SDO channel."""
    for name, (words, end) in WALKS.items():
        steps = walk(words, end)
        yield f"`{name}`, to the first SDO {end}: {len(steps)} functions."
        yield ""
        yield from table(("file", "function"), ((code(file), function) for file, function in steps))
        yield ""


def walk(words: list[str], end: str) -> list[tuple[str, str]]:
    """The (file, function) pairs that `dvtcli WORDS` has entered when it first calls *end* of an SDO channel."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / ".git").mkdir()
        (place / "net.yaml").write_text(_NETWORK, encoding="utf-8")
        kept = place / "walk.json"
        ran = subprocess.run(
            [sys.executable, "-m", "tests.documentation.reference.walks", str(kept), end, *words],
            cwd=place,
            env={"PATH": "", "PYTHONPATH": str(ROOT), **homes(place / "home")},
            capture_output=True,
            text=True,
            check=False,
        )
        if not kept.exists():
            raise AssertionError(f"dvtcli {' '.join(words)} called no {end}: {ran.stderr}")
        return [(file, function) for file, function in json.loads(kept.read_text("utf-8"))]


def _keep_walk(path: Path, end: str) -> None:
    """Write the functions that are running at the first call of *end* in bus/sdo to *path*."""

    def look(frame: FrameType, event: str, _argument: Any) -> None:
        at = frame.f_code
        if event != "call" or at.co_name != end or Path(at.co_filename).parent != PACKAGE / "bus" / "sdo":
            return
        sys.setprofile(None)
        threading.setprofile(None)
        if path.exists():
            return
        steps = _ours(frame)
        if threading.current_thread() is not threading.main_thread():
            main_thread = threading.main_thread().ident
            steps = _ours(sys._current_frames()[main_thread or 0]) + steps
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
    _keep_walk(Path(sys.argv[1]), sys.argv[2])
    sys.argv = ["dvtcli", *sys.argv[3:]]
    main()
