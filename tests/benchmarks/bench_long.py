"""What `decode`, `plot` and `check` take for long recordings, and how it grows: 10,000, 100,000 and 1,000,000 frames.

    python -m tests.benchmarks long

The recording is that of `bench_decode.py`. The time for all frames is compared with python-can's reader of the same
file, memory with the goal: it is what the process held at most. Growth is the exponent of time from 10,000 frames on,
without what a command takes for ten frames, by the least time of all rounds.
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
from tests.benchmarks.figures import ENVIRONMENT, ROOT, Figure, cpu_s

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
#: python-can's reader of a recording
READ = """
import sys
sys.modules["asammdf"] = None
import can
with can.LogReader({file!r}) as messages:
    for _ in messages:
        pass
"""
#: What python-can's reader took for a million frames (s) on the machine on which the goals in seconds were set.
READ_S = 4.4
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
    """Each of ROWS: time, growth, memory; at most three rounds."""
    with tempfile.TemporaryDirectory() as folder:
        files = {count: record(Path(folder) / f"{count}.log", count) for count in COUNTS}
        most = COUNTS[-1]
        for name, words, most_s, most_mb in ROWS:
            took, read_s = [], []
            for _ in range(min(rounds, 3)):
                took.append(
                    {count: _least_used([word.format(file) for word in words], count) for count, file in files.items()}
                )
                read_s.append(cpu_s(["-c", READ.format(file=str(files[most]))]))
            yield Figure(
                f"{name}: {most:,} frames", "s", [each[most][0] for each in took], "python-can's reader", read_s,
                most=most_s / READ_S,
            )  # fmt: skip
            start_s, few_s, all_s = (min(each[count][0] for each in took) for count in (FEW, 10_000, most))
            if all_s > few_s > start_s:  # otherwise the machine's noise is longer than 10,000 frames
                growth = log((all_s - start_s) / (few_s - start_s)) / log(most / 10_000)
                yield Figure(f"{name}: growth, n^", "", [growth], "n^1", [1.0], most=MOST_GROWTH)
            yield Figure(
                f"{name}: memory", "MB", [each[most][1] for each in took], "the goal", [most_mb] * len(took), most=1
            )
