"""Tests against one mutant at a time, each in a forked child: first in place, then with the file itself wrong.

In place: the tests are imported once, and the child gives the function that is meant the mutant's code, or the module
its constant. What no test notices so, or cannot be changed so (what is made on import), is tried once more with the
wrong file in a copy of the tree, where everything is imported anew, other processes too. Knows no mutants of its own.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType
from typing import Any

from tests.benchmarks.mutation_lines import MUTANT, PROFILE, SEED, Known, own_s
from tests.benchmarks.mutators import Mutant, functions_by_file, given_its_code, mutated, reach

ROOT = Path(__file__).parents[2]
#: a mutant that takes this many times the tests' own time, and then so many seconds more, runs for ever: noticed
_TIMES, _MORE_S = 4, 20.0
_TOO_LONG = 4  # of a child that ended itself
_IN_PLACE = "in place"
_VALUES = 5  # of a child in which only values were wrong, and no test failed
_NOT_SO = 3  # exit code of a child whose mutant cannot be made in place
_WAYS = {0: _IN_PLACE, _VALUES: "in place, in its values", _NOT_SO: "cannot be made in place"}
_COPIED = (
    "dvtcli",
    "tests",
    "scripts",
    "docs",
    "examples",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
)
_WORDS = ["-x", "-n", "0", "-q", "-p", "no:cacheprovider", "--tb=no", "-rfE", "-o", "tmp_path_retention_policy=none"]
_WORDS += ["--hypothesis-profile", PROFILE, f"--randomly-seed={SEED}"]
_WORDS += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # imported before, on purpose


@dataclass(frozen=True)
class Outcome:
    """What became of *mutant*: `killed`, `killed (file)`, `time`, `survived`, `no test`; *by* what."""

    mutant: Mutant
    what: str
    by: str = ""

    def __str__(self) -> str:
        return f"{self.what:14} {self.mutant}   {self.by}"

    @property
    def open(self) -> bool:
        """Whether nothing noticed it."""
        return self.what in ("survived", "no test")


@dataclass(frozen=True)
class Limits:
    """How many seconds of tests, by their own time on the right code, each way may take; 0: not that way."""

    in_place_s: float
    in_file_s: float
    #: what could be made in place, and passed, is not tried with the file wrong as well
    once: bool = False
    #: what is noticed has to be noticed by the same test again: where a busy machine makes tests fail
    twice: bool = False


class Bench:
    """A copy of the tree at *folder*, and what is *known* of its tests."""

    def __init__(self, folder: Path, known: Known, limits: Limits) -> None:
        self.folder, self.known, self.limits = folder, known, limits
        for name in _COPIED:
            source = ROOT / name
            ignored = shutil.ignore_patterns("__pycache__", ".hypothesis")
            (shutil.copytree(source, folder / name, ignore=ignored) if source.is_dir() else shutil.copy(source, folder))
        os.environ["PYTHONPATH"] = str(folder)

    def outcomes(self, share: Sequence[Mutant]) -> Iterator[Outcome]:
        """Try every mutant of *share*; the copy is right again after each."""
        unnoticed = [mutant for mutant in share if self._tests(mutant)]
        for mutant in share:
            if mutant not in unnoticed:
                yield Outcome(mutant, "no test", "no test runs it")
        if self.limits.in_place_s:
            found = self._in_place(unnoticed)
            unnoticed = [one.mutant for one in found if one.open and not (self.limits.once and one.by == _IN_PLACE)]
            again = unnoticed if self.limits.in_file_s else []
            yield from (one for one in found if one.mutant not in again)
        if self.limits.in_file_s:
            yield from map(self._in_file, unnoticed)

    def _tests(self, mutant: Mutant) -> list[str]:
        first, last = reach((self.folder / mutant.module).read_text("utf-8"), mutant)
        return self.known.tests(mutant.module, mutant.line, first, last)

    def _within(self, tests: Sequence[str], limit_s: float) -> tuple[list[str], float]:
        """As many of *tests* as fit in the limit, at least one, and their seconds."""
        chosen: list[str] = []
        seconds = 0.0
        for test in tests:
            seconds += self.known.seconds[test]
            if chosen and seconds > limit_s:
                break
            chosen.append(test)
        return chosen, seconds

    def _in_place(self, share: Sequence[Mutant]) -> list[Outcome]:
        """Import all tests that are needed, once, in a child; it tries each mutant in one of its own."""
        wanted = {mutant: self._within(self._tests(mutant), self.limits.in_place_s) for mutant in share}
        files = sorted({test.partition("::")[0] for tests, _ in wanted.values() for test in tests})
        said = self.folder / "outcomes"
        said.write_text("", "utf-8")
        template = os.fork()
        if not template:
            _be_pytest(self.folder, [*files], _Template(self, wanted, said))
        os.waitpid(template, 0)
        rows = [line.split("\t") for line in said.read_text("utf-8").splitlines()]
        found = {int(row[0]): Outcome(share[int(row[0])], row[1], row[2]) for row in rows}
        if missing := [mutant for number, mutant in enumerate(share) if number not in found]:
            raise SystemExit(f"not tried: {missing[0]}: {(self.folder / 'said').read_text('utf-8', 'replace')[-3000:]}")
        return [found[number] for number in range(len(share))]

    def _in_file(self, mutant: Mutant) -> Outcome:
        """Run the tests with the file wrong, everything imported anew."""
        path = self.folder / mutant.module
        right = path.read_text("utf-8")
        every = self._tests(mutant)
        tests, seconds = self._within(every, self.limits.in_file_s)
        path.write_text(mutated(right, mutant.number), "utf-8")
        try:
            _forget_compiled(path)
            code, by = self._run(tests, seconds)
            while code and self.limits.twice and by in tests and self._run([by], seconds)[0] == 0:
                tests.remove(by)  # it failed for another reason
                code, by = self._run(tests, seconds)
        finally:
            path.write_text(right, "utf-8")
            _forget_compiled(path)
        if code is None:
            return Outcome(mutant, "time", "took too long")
        if code:
            return Outcome(mutant, "killed (file)", by)
        return Outcome(mutant, "survived", f"{len(tests)} of {len(every)} tests")

    def _run(self, tests: Sequence[str], seconds: float) -> tuple[int | None, str]:
        """Run *tests* anew: the exit code, None if it took too long, and the test that failed first."""
        code = _in_child(lambda: _be_pytest(self.folder, tests, None), _TIMES * seconds + _MORE_S)
        return code, _first_failed(self.folder / "said")


class _Template:
    """pytest's plugin that, once everything is imported, forks a child for each mutant instead of running the tests."""

    def __init__(self, bench: Bench, wanted: dict[Mutant, tuple[list[str], float]], said: Path) -> None:
        self.folder, self.known, self.limits = bench.folder, bench.known, bench.limits
        self.wanted, self.said = wanted, said
        self.functions: dict[str, list[FunctionType]] = {}
        self.screen = os.dup(2)  # pytest catches the one that is there

    def pytest_runtestloop(self, session: Any) -> bool:
        """In the place of pytest's own loop."""
        items = {item.nodeid: item for item in session.items}
        for module in sorted({mutant.module for mutant in self.wanted}):
            importlib.import_module(module.removesuffix(".py").replace("/", "."))
        gc.unfreeze()  # what was collected was taken out of sight when that was over
        self.functions = functions_by_file()
        gc.collect()
        gc.freeze()  # a child need not copy what it only looks at
        for number, (mutant, (tests, seconds)) in enumerate(self.wanted.items()):
            chosen = [items[test] for test in tests if test in items]
            outcome = self._tried(mutant, chosen, seconds)
            with self.said.open("a", encoding="utf-8") as file:
                file.write(f"{number}\t{outcome.what}\t{outcome.by}\n")
            if not outcome.open:
                os.write(self.screen, f"{outcome}\n".encode())
        return True

    def _tried(self, mutant: Mutant, items: list[Any], seconds: float) -> Outcome:
        noted = self.folder / "failed"
        noted.write_text("", "utf-8")
        code = _in_child(lambda: self._be_child(mutant, items, noted), _TIMES * seconds + _MORE_S)
        if code == 1 and self.limits.twice:
            failed = noted.read_text("utf-8")
            again = [item for item in items if item.nodeid == failed]
            if _in_child(lambda: self._be_child(mutant, again, noted), _TIMES * seconds + _MORE_S) in (0, _VALUES):
                others = [item for item in items if item.nodeid != failed]
                return self._tried(mutant, others, seconds) if others else Outcome(mutant, "survived", _IN_PLACE)
        if code in (None, _TOO_LONG):
            return Outcome(mutant, "time", "took too long")
        if code not in (0, 1, _NOT_SO, _VALUES):
            raise RuntimeError(f"the child that tried {mutant} ended with {code}")
        said = noted.read_text("utf-8") or _WAYS.get(code, "")
        return Outcome(mutant, "killed" if code == 1 else "survived", said)

    def _be_child(self, mutant: Mutant, items: list[Any], noted: Path) -> None:
        text = (self.folder / mutant.module).read_text("utf-8")
        given = given_its_code(mutant.module, text, mutant.number, self.functions)
        if not given:
            os._exit(_NOT_SO)
        os.environ[MUTANT] = f"{mutant.module}\n{mutant.number}"
        config = items[0].config
        config.pluginmanager.register(_FirstFailure(noted))
        for place, item in enumerate(items):
            _end_after(_TIMES * self.known.seconds[item.nodeid] + _MORE_S / 2)
            following = items[place + 1] if place + 1 < len(items) else None
            try:
                config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            except KeyboardInterrupt:  # a Ctrl-C of the test's went further than it should
                noted.write_text(item.nodeid)
                os._exit(1)
        os._exit(0 if given == "code" else _VALUES)


class _FirstFailure:
    """pytest's plugin that ends the child where a test fails."""

    def __init__(self, noted: Path) -> None:
        self.noted = noted

    def pytest_runtest_logreport(self, report: Any) -> None:
        """A part of a test has ended."""
        if report.failed:
            self.noted.write_text(report.nodeid, "utf-8")
            os._exit(1)


def _end_after(limit_s: float) -> None:
    """End this process when it has had *limit_s* of its own time; what was said before is forgotten."""
    end_s = own_s() + limit_s

    def end_or_wait(*_: object) -> None:
        if (left_s := end_s - own_s()) <= 0:
            os._exit(_TOO_LONG)
        signal.setitimer(signal.ITIMER_REAL, left_s + 0.01)

    signal.signal(signal.SIGALRM, end_or_wait)
    signal.setitimer(signal.ITIMER_REAL, limit_s)


def _in_child(work: Callable[[], None], limit_s: float) -> int | None:
    """The exit code of a child that does *work*; None where it had to be ended."""
    child = os.fork()
    if not child:
        try:
            os.setsid()
            work()
        except BaseException:  # noqa: BLE001 - whatever it is, it is said and ends this child
            traceback.print_exc()
        finally:
            os._exit(70)
    deadline_s = own_s(child) + limit_s
    ended = (0, 0)
    while not ended[0] and own_s(child) < deadline_s:
        time.sleep(0.005)
        ended = os.waitpid(child, os.WNOHANG)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # itself, or what a failed test left behind
    if not ended[0]:
        os.waitpid(child, 0)
        return None
    return os.waitstatus_to_exitcode(ended[1])


def _be_pytest(folder: Path, tests: Sequence[str], plugin: object | None) -> None:
    """Run *tests* in *folder* and end this process with pytest's exit code; what is printed goes to `said`."""
    code = 70
    try:
        os.chdir(folder)
        sys.path[:] = [str(folder), *(place for place in sys.path if place != str(ROOT))]
        for name in [name for name in sys.modules if name.partition(".")[0] in ("tests", "dvtcli")]:
            del sys.modules[name]
        said = os.open(folder / "said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1)
        if plugin is None:
            os.dup2(said, 2)
        import pytest

        code = int(pytest.main([*_WORDS, *tests], plugins=[plugin] if plugin else []))
        sys.stdout.flush()
    except BaseException:  # noqa: BLE001 - as above
        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _first_failed(said: Path) -> str:
    lines = said.read_text("utf-8", "replace").splitlines()
    failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    return failed[0].split(" - ")[0].partition(" ")[2] if failed else " ".join(lines[-1:])


def _forget_compiled(path: Path) -> None:
    """A file of the same second and size would pass for the compiled one."""
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink(missing_ok=True)
