"""What `decode`, `plot` and `check` take for long recordings, and how it grows: 10,000, 100,000 and 1,000,000 frames.

    python -m tests.benchmarks long

The recording is that of `bench_decode.py`. Seconds are compared with the goals, growth with n^1: it is the exponent of
time without what a command takes for ten frames, from 10,000 frames on. Memory is what the process held at most.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from math import log
from pathlib import Path

from tests.benchmarks.bench_decode import FEW, NETWORK, record
from tests.benchmarks.figures import ENVIRONMENT, ROOT, Figure

COUNTS = (FEW, 10_000, 100_000, 1_000_000)
#: says at its end how much memory the process held at most (kB); python-can imports asammdf wherever that is installed,
#: which takes 100 MB
ENTRY = """
import sys
sys.modules["asammdf"] = None
from dvtcli.__main__ import entry
sys.argv[1:] = {words!r}
try:
    entry()
finally:
    with open("/proc/self/status") as file:
        print(next(line.split()[1] for line in file if line.startswith("VmHWM:")), file=sys.stderr)
"""
#: name, words with places for the recording and a file that is made, most seconds and megabytes for a million frames
ROWS: list[tuple[str, list[str], float, float]] = [
    ("decode -o CSV", ["-y", "decode", "{}", "-d", NETWORK, "-o", "{}.csv"], 30, 100),
    ("plot", ["--eds", "gen4", "plot", "{}", "6041"], 8, 100),
    ("check RECORDING", ["check", "{}", "-d", NETWORK], 25, 120),
]
MOST_GROWTH = 1.1
#: exit code of `check` with findings
FINDINGS = 3


def used(words: list[str]) -> tuple[float, float]:
    """Processor time (s) and memory (MB) that dvtcli with *words* takes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", ENTRY.format(words=words)],
        check=False, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=ROOT, env=ENVIRONMENT,
    )  # fmt: skip
    if done.returncode not in (0, FINDINGS):
        raise subprocess.CalledProcessError(done.returncode, words, stderr=done.stderr)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    taken_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return taken_s, int(done.stderr.split()[-1]) / 1024


def _least_used(words: list[str], count: int) -> tuple[float, float]:
    """As `used`; of few frames the least of some, since a start varies as much as they take."""
    return min(used(words) for _ in range(1 if count > COUNTS[1] else 5))


def figures(rounds: int) -> Iterator[Figure]:
    """Each of ROWS: seconds, growth, memory; at most three rounds."""
    with tempfile.TemporaryDirectory() as folder:
        files = {count: record(Path(folder) / f"{count}.log", count) for count in COUNTS}
        most = COUNTS[-1]
        for name, words, most_s, most_mb in ROWS:
            took = [
                {count: _least_used([word.format(file) for word in words], count) for count, file in files.items()}
                for _ in range(min(rounds, 3))
            ]
            ones = [1.0] * len(took)
            seconds = [{count: each[count][0] - each[FEW][0] for count in COUNTS} for each in took]
            yield Figure(
                f"{name}: {most:,} frames", "s", [each[most][0] for each in took], "the goal",
                [most_s * one for one in ones], most=1,
            )  # fmt: skip
            growth = [log(each[most] / each[10_000]) / log(most / 10_000) for each in seconds]
            yield Figure(f"{name}: growth, n^", "", growth, "n^1", ones, most=MOST_GROWTH)
            yield Figure(
                f"{name}: memory", "MB", [each[most][1] for each in took], "the goal",
                [most_mb * one for one in ones], most=1,
            )  # fmt: skip
