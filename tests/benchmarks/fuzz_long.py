"""The long fuzz run: every reader, the SDO client and server, and the views.

    python tests/benchmarks/fuzz_long.py [--inputs 1000000] [--jobs 2] [--seconds 7200] [--seed TEXT] [--target NAME]
    python tests/benchmarks/fuzz_long.py --atheris [--inputs N] [--seconds S]     coverage-guided (pip install atheris)

Exits with 1 where anything was found; each such input is kept in a file, with the line that runs it again.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from pathlib import Path
from time import monotonic

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from tests.fuzz.drive import SHARES, Found, run, workshop  # noqa: E402 - found where this file is

#: inputs a task, of the target with the largest share; and how long one task may take
_TASK, _STUCK_S = 500, 900
#: findings after which it is not worth going on
_ENOUGH = 20

Task = tuple[str, str, range]
_LIFE = ExitStack()


def tasks(inputs: int, seed: str, only: list[str]) -> Iterator[Task]:
    """All the work in small pieces, the targets interleaved by their shares."""
    shares = {name: share for name, share in SHARES.items() if name in only}
    total, largest = sum(shares.values()), max(shares.values())
    left = {name: range(inputs * share // total) for name, share in shares.items()}
    first = next(iter(left))
    left[first] = range(inputs - sum(len(numbers) for name, numbers in left.items() if name != first))
    while any(left.values()):
        for name, numbers in left.items():
            count = max(1, _TASK * shares[name] // largest)
            if numbers:
                yield name, seed, numbers[:count]
            left[name] = numbers[count:]


def begin() -> None:
    """A worker process: at low priority, in a folder of its own."""
    if hasattr(os, "nice"):
        os.nice(10)
    _LIFE.enter_context(workshop())


def work(task: Task) -> list[Found]:
    """Run one piece and return what was found."""
    return [found for found in run(*task) if found is not None]


def long_run(inputs: int, seed: str, jobs: int, seconds: float, kept: Path, only: list[str]) -> int:
    """Run everything over *jobs* processes; how many findings."""
    began, done, findings = monotonic(), Counter[str](), 0
    waiting = tasks(inputs, seed, only)
    running: dict[Future[list[Found]], Task] = {}
    pool = ProcessPoolExecutor(jobs, initializer=begin)
    try:
        while True:
            while len(running) < 2 * jobs and monotonic() - began < seconds and findings < _ENOUGH:
                task = next(waiting, None)
                if task is None:
                    break
                running[pool.submit(work, task)] = task
            if not running:
                break
            ended, _ = wait(running, timeout=_STUCK_S, return_when=FIRST_COMPLETED)
            if not ended:
                print(f"\nstuck for {_STUCK_S} s in one of {list(running.values())}")
                return findings + 1
            for future in ended:
                name, _, numbers = running.pop(future)
                found = future.result()
                done[name] += len(numbers)
                findings += len(found)
                for one in found:
                    keep(one, kept)
            progress(done, inputs, findings, monotonic() - began)
    except BrokenProcessPool:
        print(f"\na process died in one of {list(running.values())}")
        return findings + 1
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    took_s = monotonic() - began
    print("\n" + "\n".join(f"{name:14}{count:>10,}" for name, count in sorted(done.items())))
    print(f"{'':14}{done.total():>10,} inputs, {findings} findings, {took_s:.0f} s, seed {seed}")
    if done.total() < inputs and not findings:
        print(f"stopped after {seconds:.0f} s, before all {inputs:,} inputs")
    return findings


def keep(found: Found, kept: Path) -> None:
    """Write a finding's input to a file and say how to run it again."""
    kept.mkdir(parents=True, exist_ok=True)
    path = kept / f"{found.target}-{found.seed}-{found.number}"
    path.write_bytes(found.data)
    print(f"\n{found}\nkept: {path}")


def progress(done: Counter[str], inputs: int, findings: int, took_s: float) -> None:
    """One line that is written over at a terminal, and now and then elsewhere."""
    total = done.total()
    if sys.stdout.isatty() or total * 50 // inputs != progress_shown.get("step"):
        progress_shown["step"] = total * 50 // inputs
        end = "\r" if sys.stdout.isatty() else "\n"
        rate = total / max(took_s, 0.001)
        print(f"{total:>10,} of {inputs:,}  {rate:.0f}/s  {findings} findings  {took_s:.0f} s", end=end, flush=True)


progress_shown: dict[str, int] = {}


def guided(inputs: int, seconds: float, kept: Path, only: list[str]) -> int:
    """Every target under atheris, one after the other; how many of them found something."""
    failed = 0
    total = sum(SHARES[name] for name in only)
    for name in only:
        words = [name, str(inputs * SHARES[name] // total), str(int(seconds * SHARES[name] / total) + 1), str(kept)]
        done = subprocess.run(
            [sys.executable, "-m", "tests.fuzz.guided", *words], cwd=ROOT, capture_output=True, text=True, check=False
        )
        last = [line for line in done.stderr.splitlines() if line.startswith(("#", "Done"))][-1:]
        print(f"{name:14}{'found something' if done.returncode else 'nothing found'}  {' '.join(last)}", flush=True)
        if done.returncode:
            failed += 1
            print(done.stdout[-3000:] + done.stderr[-3000:])
    return failed


def main() -> int:
    """Run it as the command line says; 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seconds", type=float, default=7200, help="begin nothing new after this time")
    parser.add_argument("--seed", default="long")
    parser.add_argument("--target", action="append", choices=list(SHARES), help="only this one; repeatable")
    parser.add_argument("--atheris", action="store_true", help="coverage-guided, one target after the other")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "dvtcli-fuzz", metavar="DIR")
    given = parser.parse_args()
    only = given.target or list(SHARES)
    if given.atheris:
        return 1 if guided(given.inputs, given.seconds, given.keep, only) else 0
    return 1 if long_run(given.inputs, given.seed, given.jobs, given.seconds, given.keep, only) else 0


if __name__ == "__main__":
    sys.exit(main())
