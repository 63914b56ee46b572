"""`python -m tests.harness.rooms [ROOM…] [OPTION…]`: each room's tests by themselves: how many, CPU and time.

CPU is that of all processes that the tests started (user and system); on a busy machine it means more than the time.
Options are pytest's. Exit code 1 where a room fails.
"""

from __future__ import annotations

import ctypes
import os
import re
import resource
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from tests.surroundings import ROOT

_SET_CHILD_SUBREAPER = 36
#: how long what a run leaves behind may take to end (s)
_LAST_S = 10.0


@dataclass(frozen=True)
class Row:
    """A room, how many of its tests passed, CPU seconds, seconds, and what failed."""

    room: str
    passed: int
    cpu_s: float
    wall_s: float
    failed: str

    def __str__(self) -> str:
        cells = f"`{self.room}`", self.passed, f"{self.cpu_s:.0f} s", f"{self.wall_s:.0f} s"
        return f"| {' | '.join(map(str, cells))} | {self.failed}".rstrip()


def rooms(within: Path = ROOT / "tests") -> list[str]:
    """The folders of tests: `device`, and, of a folder that only holds such folders, `commands/lss`."""
    if next(within.glob("test_*.py"), None):
        return [within.relative_to(ROOT / "tests").as_posix()]
    return [room for path in sorted(within.iterdir()) if path.is_dir() for room in rooms(path)]


def measured(room: str, options: list[str]) -> Row:
    """Run the tests of *room* in processes of their own."""
    cpu_s, begin_s = _cpu_s(), time.monotonic()
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"tests/{room}", *options]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    wall_s = time.monotonic() - begin_s
    _reap()
    found = re.findall(r"(\d+) passed", done.stdout)
    failed = "" if done.returncode == 0 else f"exit code {done.returncode}: {done.stdout.strip()[-300:]}"
    return Row(room, int(found[-1]) if found else 0, _cpu_s() - cpu_s, wall_s, failed)


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _reap() -> None:
    """Wait for what a run has left behind, else it would not count."""
    until_s = time.monotonic() + _LAST_S
    while time.monotonic() < until_s:
        try:
            if os.waitpid(-1, os.WNOHANG) == (0, 0):
                time.sleep(0.05)
        except ChildProcessError:
            return


def main(words: list[str]) -> int:
    """Print the table of the rooms among *words*, or of all."""
    if sys.platform == "linux":  # whoever loses its parent becomes a child of this process
        ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    begin = next((number for number, word in enumerate(words) if word.startswith("-")), len(words))
    print("| room | tests | CPU | time |\n|---|---|---|---|")
    all_rows = []
    for room in words[:begin] or rooms():
        all_rows.append(measured(room, words[begin:]))
        print(all_rows[-1], flush=True)
    cpu_s, wall_s = sum(row.cpu_s for row in all_rows), sum(row.wall_s for row in all_rows)
    print(Row("all", sum(row.passed for row in all_rows), cpu_s, wall_s, ""))
    return int(any(row.failed for row in all_rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
