"""How long dvtcli takes to start: `python tests/benchmarks/bench_startup.py [ROUNDS]`.

Whole processes, started in turn so that what else the machine does falls on all alike; each is compared with a bare
import of what it cannot do without. Prints medians, and the median of the rounds' ratios.
Goals: `--help` at most 1.3 times `import click`, a one-shot `read` on a simulated node at most 2.5 times `import can`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

ROOT = Path(__file__).resolve().parents[2]
#: byte code is cached, as it is where dvtcli was installed
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
ENTRY = "import sys; from dvtcli.__main__ import entry; sys.argv[1:] = {words!r}; entry()"
#: name, words of Python's command line, goal as a ratio to the row before it
ROWS: list[tuple[str, list[str], float | None]] = [
    ("python -c pass", ["-c", "pass"], None),
    ("python -c 'import click'", ["-c", "import click"], None),
    ("dvtcli --help", ["-c", ENTRY.format(words=["--help"])], 1.3),
    ("python -c 'import can'", ["-c", "import can"], None),
    ("dvtcli --sim gen4 read 6041", ["-c", ENTRY.format(words=["--sim", "gen4", "read", "6041"])], 2.5),
]


def seconds(words: list[str]) -> float:
    """How long one process takes, from start to end."""
    started = perf_counter()
    subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL, cwd=ROOT, env=ENVIRONMENT)
    return perf_counter() - started


def measure(rounds: int) -> list[list[float]]:
    """Seconds of each of ROWS, *rounds* times."""
    for _, words, _ in ROWS:
        seconds(words)  # compile, and fill the file cache
    return [[seconds(words) for _, words, _ in ROWS] for _ in range(rounds)]


def main(rounds: int = 21) -> None:
    """Measure and print the table."""
    times = measure(rounds)
    print(f"{'start-up':32}{'median':>10}{'ratio':>8}{'goal':>7}   {rounds} rounds")
    for column, (name, _, goal) in enumerate(ROWS):
        line = f"{name:32}{1000 * median(row[column] for row in times):7.1f} ms"
        if goal is not None:
            line += f"{median(row[column] / row[column - 1] for row in times):8.2f}{goal:7.2f}"
        print(line)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
