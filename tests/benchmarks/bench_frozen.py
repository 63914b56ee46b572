"""How long a program without Python takes from start to end, beside an installed dvtcli.

    python -m tests.benchmarks.bench_frozen INSTALLED PROGRAM... [--rounds N]

INSTALLED is the command in an environment; each PROGRAM is what `scripts/freeze.py` made. Prints rows in Markdown:
medians of processor time (user and system) and of time by the clock, each started in turn.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from tests.surroundings import clean_environment, homes

COMMANDS = ("--version", "--help", "--sim gen4 pdo", "--sim gen4 --yes map tpdo3 6041")


def times(words: Sequence[str], home: str) -> tuple[float, float]:
    """Processor time and time by the clock, in ms, of a process with *words*."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    environment = clean_environment() | homes(Path(home))
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL, cwd=home, env=environment)
    ended, after = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return 1000 * used, 1000 * (ended - began)


def rows(installed: str, programs: Sequence[str], rounds: int) -> Iterator[str]:
    """A row of each command: what INSTALLED takes, then each program with the median of its ratios."""
    with TemporaryDirectory(prefix="dvtcli-bench-") as home:
        for command in COMMANDS:
            each = [
                [times([program, *command.split()], home) for program in (installed, *programs)] for _ in range(rounds)
            ]
            for kind, unit in enumerate(("processor", "clock")):
                cells = []
                for number in range(1 + len(programs)):
                    taken = [measured[number][kind] for measured in each]
                    ratio = median(measured[number][kind] / measured[0][kind] for measured in each)
                    cells.append(f"{median(taken):.0f} ms" + (f" ({ratio:.1f} times)" if number else ""))
                yield f"| `dvtcli {command}` | {unit} | {' | '.join(cells)} |"


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("installed", metavar="INSTALLED", type=os.path.abspath)
    parser.add_argument("programs", metavar="PROGRAM", nargs="+", type=os.path.abspath)
    parser.add_argument("--rounds", type=int, default=15)
    asked = parser.parse_args()
    print("| command | time | installed |", " | ".join(asked.programs), "|")
    print("|---" * (3 + len(asked.programs)) + "|")
    for row in rows(asked.installed, asked.programs, asked.rounds):
        print(row, flush=True)


if __name__ == "__main__":
    main()
