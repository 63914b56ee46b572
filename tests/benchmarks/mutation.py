"""Changes to the code that no test notices: one small fault at a time, in a copy, against the tests of that file.

    python tests/benchmarks/mutation.py [--sample N] [--seed TEXT] [--modules PATTERN…] [--jobs N] [--list]

A mutant that the tests let pass is tried against the wider ones; what passes these too is printed, unless
`mutation_explained.toml` says why it changes nothing. Exits with 1 where anything is left to explain.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import tomllib
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from tests.benchmarks.mutators import Mutant, mutants, mutated  # noqa: E402 - found where this file is

EXPLAINED = Path(__file__).with_name("mutation_explained.toml")
MODULES = ("dvtcli/domain/plan.py", "dvtcli/domain/rules/*", "dvtcli/device/*", "dvtcli/bus/sdo_*")
#: which tests are about a file, the quickest first; then all that could notice, for what those let pass
NARROW: dict[str, tuple[str, ...]] = {
    "dvtcli/domain/plan.py": (
        "tests/domain/test_plan.py",
        "tests/domain/test_rtr_first.py",
        "tests/domain/test_plan_of_the_notes.py",
    ),
    "dvtcli/domain/rules/*": ("tests/rules",),
    "dvtcli/bus/sdo_*": ("tests/bus/test_sdo_client.py", "tests/bus/test_contract.py"),
    "dvtcli/device/access_level.py": ("tests/device", "tests/commands/test_login.py"),
    "dvtcli/device/*": ("tests/device",),
}
WIDE = (
    "tests/device", "tests/rules", "tests/domain", "tests/bus", "tests/laws", "tests/simulator/test_twin.py",
    "tests/commands", "tests/transcripts", "tests/scripts", "tests/recovery",
)  # fmt: skip
#: a mutant that takes this many times the tests' own time, and then so many seconds more, runs for ever: noticed
_TIMES, _MORE_S = 4, 30.0
PASSED, FAILED, INTERRUPTED = 0, 1, 2  # pytest's exit codes; a file that cannot be imported interrupts it
_COPIED = ("dvtcli", "tests", "scripts", "pyproject.toml", "README.md")


@dataclass(frozen=True)
class Outcome:
    """What became of *mutant*: `killed`, `killed (wide)`, `time`, `survived`; *by* the test that failed."""

    mutant: Mutant
    what: str
    by: str = ""


class Bench:
    """A copy of the tree in which one file at a time is wrong, and pytest in a forked child."""

    def __init__(self, folder: Path, *, wide: bool) -> None:
        self.folder = folder
        self.wide = wide
        self._usual_s: dict[tuple[str, ...], float] = {}
        for name in _COPIED:
            source = ROOT / name
            ignored = shutil.ignore_patterns("__pycache__", ".hypothesis")
            (shutil.copytree(source, folder / name, ignore=ignored) if source.is_dir() else shutil.copy(source, folder))

    def try_one(self, mutant: Mutant) -> Outcome:
        """Run the tests against *mutant*; the file is right again afterwards."""
        path = self.folder / mutant.module
        right = path.read_text("utf-8")
        narrow = next(tests for pattern, tests in NARROW.items() if fnmatch(mutant.module, pattern))
        stages = [("killed", narrow), *([("killed (wide)", WIDE)] if self.wide else [])]
        for _, tests in stages:
            self._measure(tests)
        path.write_text(mutated(right, mutant.number), "utf-8")
        try:
            for what, tests in stages:
                code, said = self._run(tests, _TIMES * self._usual_s[tests] + _MORE_S)
                if code != PASSED:
                    return Outcome(mutant, "time" if code is None else what, said)
            return Outcome(mutant, "survived")
        finally:
            path.write_text(right, "utf-8")
            self._forget_compiled(path)

    def _measure(self, tests: tuple[str, ...]) -> None:
        """The tests' own time on the right code, which they must pass."""
        if tests not in self._usual_s:
            started_s = time.monotonic()
            code, said = self._run(tests, 3600)
            if code != PASSED:
                raise SystemExit(f"the tests fail without any mutant: {' '.join(tests)}: {said}")
            self._usual_s[tests] = time.monotonic() - started_s

    def _run(self, tests: Sequence[str], limit_s: float) -> tuple[int | None, str]:
        """pytest's exit code, None where it had to be ended, and the first test that failed."""
        for path in (self.folder / "dvtcli").rglob("*.py"):
            self._forget_compiled(path)  # a file of the same second and size would pass for the compiled one
        child = os.fork()
        if not child:
            self._be_pytest(tests)
        deadline_s = time.monotonic() + limit_s
        while not (ended := os.waitpid(child, os.WNOHANG))[0]:
            if time.monotonic() > deadline_s:
                os.killpg(child, signal.SIGKILL)
                os.waitpid(child, 0)
                return None, "took too long"
            time.sleep(0.02)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what a failed test left behind
        said = (self.folder / "said").read_text("utf-8", "replace").splitlines()
        failed = [line for line in said if line.startswith(("FAILED", "ERROR"))]
        return os.waitstatus_to_exitcode(ended[1]), failed[0].split(" - ")[0] if failed else " ".join(said[-1:])

    def _be_pytest(self, tests: Sequence[str]) -> None:
        code = 70
        try:
            os.setsid()
            os.chdir(self.folder)
            sys.path[:] = [str(self.folder), *(place for place in sys.path if place != str(ROOT))]
            for name in [name for name in sys.modules if name.partition(".")[0] in ("tests", "dvtcli")]:
                del sys.modules[name]
            said = os.open(self.folder / "said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(said, 1)
            os.dup2(said, 2)
            import pytest

            words = ["-x", "-n", "0", "-q", "-p", "no:randomly", "-p", "no:cacheprovider", "--tb=no", "-rfE"]
            words += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # imported before, on purpose
            code = int(pytest.main([*words, *tests]))
            sys.stdout.flush()
        except BaseException:  # noqa: BLE001 - whatever it is, it is said and ends this child
            traceback.print_exc()
            sys.stderr.flush()
        finally:
            os._exit(code)

    def _forget_compiled(self, path: Path) -> None:
        for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
            compiled.unlink(missing_ok=True)


def _prepare() -> None:
    """What every child would import first, once; none of ours."""
    import can  # noqa: F401
    import canopen  # noqa: F401
    import click  # noqa: F401
    import pytest  # noqa: F401
    from hypothesis import HealthCheck, Phase, settings

    found_out = (Phase.explicit, Phase.generate)  # whether, not the smallest example
    checks = list(HealthCheck)
    settings.register_profile(
        "mutation",
        settings(phases=found_out, deadline=None, database=None, suppress_health_check=checks),
        derandomize=True,
        max_examples=30,
    )
    settings.load_profile("mutation")


def work(share: Sequence[Mutant], wide: bool) -> Iterator[Outcome]:
    """Try each mutant of *share* in a copy of our own."""
    _prepare()
    with tempfile.TemporaryDirectory(prefix="dvtcli-mutation-", ignore_cleanup_errors=True) as folder:
        bench = Bench(Path(folder), wide=wide)
        for mutant in share:
            yield bench.try_one(mutant)


def _work(share: Sequence[Mutant], wide: bool) -> list[Outcome]:
    return [_told(outcome) for outcome in work(share, wide)]


def _told(outcome: Outcome) -> Outcome:
    print(f"{outcome.what:14} {outcome.mutant}   {outcome.by}", flush=True)
    return outcome


def explained() -> dict[tuple[str, str, str], str]:
    """Why a mutant changes nothing, by file, function and change."""
    rows = tomllib.loads(EXPLAINED.read_text("utf-8")).get("explained", []) if EXPLAINED.exists() else []
    return {(row["module"], row["function"], row["change"]): row["why"] for row in rows}


def chosen(patterns: Sequence[str], sample: int | None, seed: str) -> list[Mutant]:
    """The mutants of the files that match, or *sample* of them; always the same ones for the same *seed*."""
    files = [path for path in sorted((ROOT / "dvtcli").rglob("*.py")) if path.name != "__init__.py"]
    names = [str(path.relative_to(ROOT)) for path in files]
    every = [m for name in names if any(fnmatch(name, p) for p in patterns) for m in mutants(ROOT, name)]
    if sample is None or sample >= len(every):
        return every
    return sorted(random.Random(seed).sample(every, sample))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, metavar="N", help="this many mutants, chosen by --seed [all]")
    parser.add_argument("--seed", default="dvtcli", help="which ones [dvtcli]")
    parser.add_argument("--modules", nargs="+", default=MODULES, metavar="PATTERN", help=f"files {' '.join(MODULES)}")
    parser.add_argument("--matching", default="", metavar="TEXT", help="only those that --list prints with TEXT in it")
    parser.add_argument(
        "--again", type=Path, metavar="LOG", help="only those that an earlier run's output says survived"
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="copies that work at a time [1]")
    parser.add_argument("--narrow", action="store_true", help="do not try the wider tests on what passes the file's")
    parser.add_argument("--list", action="store_true", help="only list the mutants")
    given = parser.parse_args()
    todo = [one for one in chosen(given.modules, given.sample, given.seed) if given.matching in str(one)]
    if given.again is not None:
        lines = [line.split(maxsplit=1) for line in given.again.read_text("utf-8").splitlines()]
        survivors = {line[1].strip() for line in lines if line[:1] == ["survived"]}
        todo = [one for one in todo if str(one) in survivors]
    if given.list:
        print(*todo, f"{len(todo)} mutants", sep="\n")
        return 0
    started_s = time.monotonic()
    known = explained()
    open_ones = [mutant for mutant in todo if mutant.key not in known]
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(given.jobs) as pool:
        shares = [open_ones[start :: given.jobs] for start in range(given.jobs)]
        for done in as_completed([pool.submit(_work, share, not given.narrow) for share in shares if share]):
            outcomes += done.result()
    survived = sorted(outcome.mutant for outcome in outcomes if outcome.what == "survived")
    counts = Counter(outcome.what for outcome in outcomes)
    print(
        f"\n{len(todo)} mutants in {time.monotonic() - started_s:.0f} s: {len(todo) - len(open_ones)} explained, ",
        end="",
    )
    print(", ".join(f"{number} {what}" for what, number in sorted(counts.items())) or "none left")
    for mutant in survived:
        print(f'\n[[explained]]\nmodule = "{mutant.module}"\nfunction = "{mutant.function}"')
        print(f"change = '''{mutant.change}'''\nwhy = \"\"  # line {mutant.line}")
    return 1 if survived else 0


if __name__ == "__main__":
    sys.exit(main())
