"""Changes to the code that no test notices: one small fault at a time, in a copy, against the tests that run its lines.

    python tests/benchmarks/mutation.py [--sample N] [--seed TEXT] [--modules PATTERN…] [--jobs N] [--list]
    python tests/benchmarks/mutation.py --baseline FILE

First finds out which tests run which lines (`--map FILE` keeps that for the next run of the same code), then tries each
mutant on them, the quickest first. What passes is printed, unless `mutation_explained.toml` says why it changes
nothing. Exits with 1 where anything is left to explain.

A baseline is a file of mutants of domain and device with what became of each. Its mutants that the code still has are
tried again, on tests of the rooms near them, on a lot of those of commands, operations and files, and on quick ones;
others by lot stand in for those that are gone; then the file is written anew. Exits with 1 if a mutant survives that
was noticed before.
"""

from __future__ import annotations

import argparse
import random
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from tests.benchmarks.mutation_bench import Bench, Limits, Outcome  # noqa: E402 - found where this file is
from tests.benchmarks.mutation_lines import Known, register_profile  # noqa: E402
from tests.benchmarks.mutators import Mutant, mutants  # noqa: E402

EXPLAINED = Path(__file__).with_name("mutation_explained.toml")
MODULES = (
    "dvtcli/domain/plan.py", "dvtcli/domain/plan.py", "dvtcli/domain/rules/*", "dvtcli/device/*", "dvtcli/bus/sdo/*",
)  # fmt: skip
#: the tests of the files' own rooms, and those that look from further away
NEAR = ("tests/device", "tests/domain", "tests/bus", "tests/fuzz/test_found.py")
#: tests that few mutants outside of their own folder need, and that take long
LEARNING = "tests/device/learn"
WIDE = (
    "tests/laws", "tests/simulator/test_twin.py", "tests/cli/commands", "tests/transcripts", "tests/scripts",
    "tests/recovery", "tests/faults", "tests/simulator/serve",
)  # fmt: skip
#: of a baseline: how many mutants, of which files; tests of which the lot is taken, and of which the quick ones
BASELINE, BASELINE_MODULES = 300, ("dvtcli/domain/*", "dvtcli/device/*")
LOT = (
    "--cases", "lot", "-m", "not long", "tests/cli/commands", "tests/operations", "tests/files", "tests/laws",
)  # fmt: skip
QUICK = (
    "-m", "quick", "tests/simulator/test_twin.py", "tests/transcripts", "tests/scripts", "tests/recovery",
    "tests/faults", "tests/simulator/serve", "tests/cli/dvt", "tests/cli/view",
)  # fmt: skip


def record(to: Path, modules: Sequence[str], tests: Sequence[str]) -> None:
    """Find out what *tests* run of the files of *modules*."""
    words = ["-m", "tests.benchmarks.mutation_lines", str(to), *modules, "--", *tests]
    done = subprocess.run([sys.executable, *words], cwd=ROOT, check=False)
    if done.returncode not in (0, 1):  # a test that fails is left out, and was named
        raise SystemExit(f"the tests could not be run: exit code {done.returncode}")


def prepare() -> None:
    """What every child would import first, once; none of ours."""
    import can  # noqa: F401
    import canopen  # noqa: F401
    import click  # noqa: F401
    import pytest  # noqa: F401

    register_profile()


def work(share: Sequence[Mutant], known: Path, limits: Limits) -> list[Outcome]:
    """Try each mutant of *share* in a copy of our own."""
    prepare()
    with tempfile.TemporaryDirectory(prefix="dvtcli-mutation-", ignore_cleanup_errors=True) as folder:
        found = []
        for outcome in Bench(Path(folder), Known(known), limits).outcomes(share):
            if outcome.what != "killed":  # that was said
                print(outcome, flush=True)
            found.append(outcome)
        return found


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


def of_baseline(file: Path, patterns: Sequence[str], seed: str) -> list[Mutant]:
    """The mutants of a baseline that the code still has, and others by lot until there are as many as before."""
    every = chosen(patterns, None, seed)
    random.Random(seed).shuffle(every)
    known = _outcomes_in(file)
    kept = {_without_line(str(mutant)): mutant for mutant in reversed(every) if _without_line(str(mutant)) in known}
    others = [mutant for mutant in every if _without_line(str(mutant)) not in known]
    if known:
        print(f"{len(known) - len(kept)} of {len(known)} mutants of {file} are gone")
    return sorted([*kept.values(), *others[: max(0, BASELINE - len(kept))]])


def _outcomes_in(file: Path) -> dict[str, str]:
    """What became of each mutant of a baseline by then; nothing if there is no such file."""
    lines = file.read_text("utf-8").splitlines() if file.exists() else []
    return {line[15:]: line[:15].rstrip() for line in lines if line and not line.startswith("#")}


def write_baseline(file: Path, every: Sequence[Mutant], outcomes: Sequence[Outcome]) -> list[str]:
    """Write what became of *every* mutant; those that survive and were noticed before, as they stand in the file.

    What was not tried stays as it stands there, or is explained, or left out.
    """
    before, known = _outcomes_in(file), explained()
    now = {_without_line(str(mutant)): "explained" for mutant in every if mutant.key in known}
    now |= {key: before[key] for key in map(_without_line, map(str, every)) if key in before}
    now |= {_without_line(str(outcome.mutant)): outcome.what for outcome in outcomes}
    counts = ", ".join(f"{number} {what}" for what, number in sorted(Counter(now.values()).items()))
    rows = [f"{what:14} {mutant}" for mutant, what in sorted(now.items())]
    head = ["# Small faults in the code, and whether a test notices: see mutation.py --baseline.", f"# {counts}"]
    file.write_text("\n".join([*head, *rows, ""]), "utf-8")
    unnoticed = ("survived", "no test")
    return [row for row in rows if row[:14].rstrip() in unnoticed and before.get(row[15:], "survived") not in unnoticed]


def arguments() -> argparse.Namespace:
    """What was given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, metavar="N", help="this many mutants, chosen by --seed [all]")
    parser.add_argument("--seed", default="dvtcli", help="which ones [dvtcli]")
    parser.add_argument("--modules", nargs="+", metavar="PATTERN", help=f"files {' '.join(MODULES)}")
    parser.add_argument("--matching", default="", metavar="TEXT", help="only those that --list prints with TEXT in it")
    parser.add_argument(
        "--again", type=Path, metavar="LOG", help="only those that an earlier run's output says survived"
    )
    parser.add_argument(
        "--done",
        type=Path,
        nargs="+",
        default=(),
        metavar="LOG",
        help="not those that earlier output says are noticed",
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="copies that work at a time [1]")
    parser.add_argument("--map", type=Path, metavar="FILE", help="which tests run which lines, where it is known")
    parser.add_argument("--narrow", action="store_true", help="only the tests of the files' own rooms")
    parser.add_argument("--in-place", type=float, default=20, metavar="S", help="of tests in place; 0: not so [20]")
    parser.add_argument("--in-file", type=float, default=60, metavar="S", help="of tests with the file wrong [60]")
    parser.add_argument("--once", action="store_true", help="with the file wrong: only what cannot be made in place")
    parser.add_argument("--twice", action="store_true", help="noticed is what the same test notices again: when busy")
    parser.add_argument("--baseline", type=Path, metavar="FILE", help="try what it names again, and write it anew")
    parser.add_argument("--list", action="store_true", help="only list the mutants")
    given = parser.parse_args()
    given.modules = given.modules or (MODULES if given.baseline is None else BASELINE_MODULES)
    return given


def main() -> int:
    given = arguments()
    if given.baseline is None:
        every = chosen(given.modules, given.sample, given.seed)
    else:
        every = of_baseline(given.baseline, given.modules, given.seed)
    todo = [one for one in every if given.matching in str(one)]
    if given.again is not None:
        survivors = _said_of(given.again, "survived", "no test")
        todo = [one for one in todo if _without_line(str(one)) in survivors]
    for log in given.done:
        noticed = _said_of(log, "killed", "killed (file)", "time")
        todo = [one for one in todo if _without_line(str(one)) not in noticed]
    if given.list:
        print(*todo, f"{len(todo)} mutants", sep="\n")
        return 0
    started_s = time.monotonic()
    known = explained()
    open_ones = [mutant for mutant in todo if mutant.key not in known]
    outcomes = _tried(open_ones, given)
    survived = sorted(outcome.mutant for outcome in outcomes if outcome.open)
    counts = Counter(outcome.what for outcome in outcomes)
    print(
        f"\n{len(todo)} mutants in {time.monotonic() - started_s:.0f} s: {len(todo) - len(open_ones)} explained, ",
        end="",
    )
    print(", ".join(f"{number} {what}" for what, number in sorted(counts.items())) or "none left")
    if given.baseline is not None:
        lost = write_baseline(given.baseline, every, outcomes)
        print(*lost, f"{len(lost)} that were noticed before are not now", sep="\n")
        return 1 if lost else 0
    for mutant in survived:
        print(f'\n[[explained]]\nmodule = "{mutant.module}"\nfunction = "{mutant.function}"')
        print(f"change = '''{mutant.change}'''\nwhy = \"\"  # line {mutant.line}")
    return 1 if survived else 0


def _said_of(log: Path, *outcomes: str) -> set[str]:
    """Which mutants an earlier run's output *log* says one of *outcomes* of."""
    lines = log.read_text("utf-8").splitlines()
    return {_without_line(line[15:].partition("   ")[0]) for line in lines if line[:15].rstrip() in outcomes}


def _without_line(text: str) -> str:
    """What is printed of a mutant, wherever it stands by now."""
    return re.sub(r"(?<=\.py):\d+", "", text, count=1)


def _tried(open_ones: Sequence[Mutant], given: argparse.Namespace) -> list[Outcome]:
    with tempfile.TemporaryDirectory(prefix="dvtcli-mutation-") as folder, ProcessPoolExecutor(given.jobs) as pool:
        lines = (given.map or Path(folder) / "lines").resolve()
        if not lines.exists():
            near = NEAR if given.baseline else (*NEAR, f"--ignore={LEARNING}")
            record(lines, given.modules, near if given.narrow or given.baseline else (*near, *WIDE))
            for more in (LOT, QUICK) if given.baseline is not None else ():
                record(lines, given.modules, more)
        limits = Limits(given.in_place, given.in_file, given.once or given.baseline is not None, given.twice)
        shares = [open_ones[start :: given.jobs] for start in range(given.jobs)]
        done = as_completed([pool.submit(work, share, lines, limits) for share in shares if share])
        return [outcome for share in done for outcome in share.result()]


if __name__ == "__main__":
    sys.exit(main())
