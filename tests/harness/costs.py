"""What each test takes of the processors: `pytest --costs FOLDER` measures it.

`python -m tests.harness.costs FOLDER` shows it. With `--write` the tests that take much go to `heavy.txt`, of which
`sample.py` takes a part by lot: a fifth of a second, or a tenth for each of several cases. What a run did not take
stays there as it was, unless it is gone. Only for Linux, which says what other processes take.
"""

from __future__ import annotations

import json
import os
import re
import resource
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.surroundings import ROOT

#: the tests that take much of the processors, without their cases, one a line
HEAVY = Path(__file__).with_name("heavy.txt")
#: what is much for a test that has one case, and for each case of another one on average (s)
MUCH_S, MUCH_FOR_A_CASE_S = 0.2, 0.1


class Costs:
    """A plugin that writes into *folder* what this process and those that it started took for each test."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._taken_s = folder, dict[str, float]()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        begin_s = _cpu_s()
        try:
            return (yield)
        finally:
            self._taken_s[item.nodeid] = _cpu_s() - begin_s

    def pytest_sessionfinish(self) -> None:
        self._folder.mkdir(exist_ok=True)
        (self._folder / f"{os.getpid()}.json").write_text(json.dumps(self._taken_s), "utf-8")


def _cpu_s() -> float:
    """Return the processor time of this process, of its children that ended, and of those that live, with theirs."""
    own = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    taken_s = sum(used.ru_utime + used.ru_stime for used in own)
    ticks, processes = 0, [str(os.getpid())]
    while processes:
        threads = Path("/proc", processes.pop(), "task")
        children: list[str] = []
        with suppress(OSError):  # it has ended meanwhile
            for thread in threads.iterdir():
                children += (thread / "children").read_text("utf-8").split()
        for child in children:
            with suppress(OSError):
                fields = Path("/proc", child, "stat").read_text("utf-8").rpartition(")")[2].split()
                ticks += sum(map(int, fields[11:15]))  # utime, stime, cutime, cstime
                processes.append(child)
    return taken_s + ticks / os.sysconf("SC_CLK_TCK")


def heavy_tests() -> frozenset[str]:
    """Return the node IDs of the tests that take much, without their cases."""
    return frozenset(HEAVY.read_text("utf-8").split())


def per_test(folder: Path) -> dict[str, dict[str, float]]:
    """Return what each case took (s), by the node ID of its test."""
    cases: dict[str, dict[str, float]] = defaultdict(dict)
    for path in folder.glob("*.json"):
        for node_id, taken_s in json.loads(path.read_text("utf-8")).items():
            cases[node_id.partition("[")[0]][node_id] = taken_s
    return cases


def takes_much(test: str, cases: dict[str, float]) -> bool:
    """Whether *test* takes much of the processors, if its *cases* take so many seconds."""
    return sum(cases.values()) >= len(cases) * (MUCH_S if test in cases else MUCH_FOR_A_CASE_S)


def is_there(test: str) -> bool:
    """Whether there is still a *test* of that node ID, as far as its file says by itself."""
    file, *names = test.split("::")
    path = ROOT / file
    return path.exists() and bool(re.search(rf"\b(def|class) {names[0]}\b", path.read_text("utf-8")))


def main(words: list[str]) -> int:
    """Print the tests by what all of their cases took, which most first."""
    folder, *options = words
    tests = per_test(Path(folder))
    all_s = {test: sum(cases.values()) for test, cases in tests.items()}
    print("| CPU | cases | test |\n|---|---|---|")
    for test in sorted(tests, key=all_s.__getitem__, reverse=True):
        print(f"| {all_s[test]:.2f} s | {len(tests[test])} | {test} |")
    print(f"| {sum(all_s.values()):.2f} s | {sum(map(len, tests.values()))} | all |")
    if "--write" in options:
        much = {test for test, cases in tests.items() if takes_much(test, cases)}
        much |= {test for test in heavy_tests() - set(tests) if is_there(test)}
        HEAVY.write_text("".join(f"{test}\n" for test in sorted(much)), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
