"""Which tests run which lines of which files, in the tests' own process and in those that they start.

    python -m tests.benchmarks.mutation_lines FILE PATTERN… -- TEST…

adds what the TESTs run of the files that match to FILE, one JSON document a test. A test that fails is left out, and
named. What a fixture of a whole file runs counts for the first test that needs it.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[2]  # a test's folder has `tests` as a link
#: Hypothesis' profile for these runs
PROFILE = "mutation"
#: of these runs: which cases a lot takes must be the same in all of them
SEED = 1
#: for the processes that tests start: the file to add lines to, and the patterns; or module and number of a mutant
_TO, _WANTED, MUTANT = "PYTEST_MUTATION_LINES", "PYTEST_MUTATION_PATTERNS", "PYTEST_MUTATION_MUTANT"


def own_s(process: int | str = "self") -> float:
    """A clock that stands still while the process' main thread waits for a core: in seconds."""
    try:
        waited_ns = int(Path(f"/proc/{process}/schedstat").read_text("ascii").split()[1])
    except (OSError, IndexError):  # it has ended, or this system does not say so
        waited_ns = 0
    return time.monotonic() - waited_ns / 1e9


class Lines:
    """What is run from now on, in every thread: `seen` holds file and line."""

    def __init__(self, patterns: tuple[str, ...]) -> None:
        self.seen: set[tuple[str, int]] = set()
        self._patterns = patterns
        self._names: dict[str, str] = {}
        self.listen()

    def listen(self) -> None:
        """Hear what is run from now on: a Ctrl-C in the middle of it, as some tests send, ends that."""
        threading.settrace(self._call)
        sys.settrace(self._call)

    def _call(self, frame: FrameType, event: str, arg: object) -> Any:
        path = frame.f_code.co_filename
        if path not in self._names:
            self._names[path] = self._name(path)
        return self._line if self._names[path] else None

    def _name(self, path: str) -> str:
        name = path.removeprefix(f"{ROOT}/")
        return name if name != path and any(fnmatch(name, one) for one in self._patterns) else ""

    def _line(self, frame: FrameType, event: str, arg: object) -> Any:
        self.found(self._names[frame.f_code.co_filename], frame.f_lineno)
        return self._line

    def found(self, name: str, line: int) -> None:
        """A line was run."""
        self.seen.add((name, line))


class _Written(Lines):
    """In a process that a test started, and may kill: each line is written down the first time it is run."""

    def __init__(self, patterns: tuple[str, ...], path: str, test: str) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        self._test = test
        super().__init__(patterns)

    def found(self, name: str, line: int) -> None:
        if (name, line) not in self.seen:
            self.seen.add((name, line))
            os.write(self._file, (json.dumps([self._test, name, line]) + "\n").encode())


def in_started_process() -> None:
    """Called in every dvtcli that is forked for a test: its lines are recorded, or one of them made wrong."""
    if MUTANT in os.environ:
        from tests.benchmarks.mutators import given_its_code

        module, _, number = os.environ[MUTANT].partition("\n")
        given_its_code(module, (ROOT / module).read_text("utf-8"), int(number))
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]
    if test and _TO in os.environ:
        _Written(tuple(os.environ[_WANTED].split("\n")), os.environ[_TO], test)


class Recorder:
    """For pytest: adds to the file what each test ran."""

    def __init__(self, to: Path, patterns: tuple[str, ...]) -> None:
        self.to = to
        self.others = to.with_suffix(".others")
        self.others.write_text("", "utf-8")
        self.rows: dict[str, dict[str, Any]] = {}
        self.failed: set[str] = set()
        os.environ[_TO], os.environ[_WANTED] = str(self.others), "\n".join(patterns)
        self.lines = Lines(patterns)

    def pytest_runtest_protocol(self, item: Any) -> None:
        """A test begins."""
        self.lines.seen.clear()
        self.lines.listen()
        self.started_s = own_s()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """A test has ended."""
        seconds = round(own_s() - self.started_s, 3)
        self.rows[nodeid] = {"test": nodeid, "seconds": seconds, "lines": self._by_file(self.lines.seen.copy())}

    def pytest_runtest_logreport(self, report: Any) -> None:
        """A part of a test has ended."""
        if report.failed:
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """All tests have ended."""
        sys.settrace(None)
        for text in self.others.read_text("utf-8").splitlines():
            test, name, line = json.loads(text)
            if test in self.rows:
                lines = self.rows[test]["lines"].setdefault(name, [])
                lines.append(line)
        with self.to.open("a", encoding="utf-8") as file:
            for test, row in self.rows.items():
                if test not in self.failed:
                    file.write(json.dumps(row) + "\n")
        print(f"\n{len(self.rows) - len(self.failed)} tests known, left out as they fail: {sorted(self.failed)}")

    def _by_file(self, seen: set[tuple[str, int]]) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for name, line in sorted(seen):
            found.setdefault(name, []).append(line)
        return found


class Known:
    """What was recorded in *path*."""

    def __init__(self, path: Path) -> None:
        self.seconds: dict[str, float] = {}
        self._ran: dict[str, dict[str, frozenset[int]]] = {}
        for text in path.read_text("utf-8").splitlines():
            row = json.loads(text)
            self.seconds[row["test"]] = row["seconds"]
            for name, lines in row["lines"].items():
                self._ran.setdefault(name, {})[row["test"]] = frozenset(lines)

    def tests(self, module: str, line: int, first: int, last: int) -> list[str]:
        """The tests that run anything of *first* to *last* in *module*.

        Those that run *line* come before the others, and the quick ones first. A second test of the same way through
        the module counts as if it took twice its time, a third one three times, and each outside of the module's own
        rooms twice.
        """
        rooms = Path(module).parts[1:-1]
        runners: Counter[frozenset[int]] = Counter()

        def ordered() -> Iterator[tuple[bool, float, str]]:
            found = [
                (self.seconds[test], test, lines)
                for test, lines in self._ran.get(module, {}).items()
                if any(first <= one <= last for one in lines)
            ]
            for seconds, test, lines in sorted(found, key=lambda row: row[:2]):
                runners[lines] += 1
                yield line not in lines, seconds * runners[lines] * (1 if test.split("/")[1] in rooms else 2), test

        return [test for *_, test in sorted(ordered())]


def register_profile() -> None:
    """Make Hypothesis' profile `mutation`: few examples, always the same; whether, not the smallest one."""
    from hypothesis import HealthCheck, Phase, settings

    settings.register_profile(
        PROFILE,
        settings(
            phases=(Phase.explicit, Phase.generate), deadline=None, database=None,
            suppress_health_check=list(HealthCheck),
        ),
        derandomize=True,
        max_examples=30,
    )  # fmt: skip


def main() -> int:
    import pytest

    register_profile()

    to, *rest = sys.argv[1:]
    patterns, tests = rest[: rest.index("--")], rest[rest.index("--") + 1 :]
    recorder = Recorder(Path(to).resolve(), tuple(patterns))
    words = ["-n", "0", "-q", "-p", "no:cacheprovider", "--tb=no", "--hypothesis-profile", PROFILE]
    words += [f"--randomly-seed={SEED}"]
    words += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # imported before, on purpose
    return int(pytest.main([*words, *tests], plugins=[recorder]))


if __name__ == "__main__":
    sys.exit(main())
