"""Every step of every sequence × every fault × every family, as one table: `python tests/benchmarks/fault_matrix.py`.

Each cell is a session of real commands on a strict simulated device in virtual time; afterwards the device itself is
looked at. It must hold the old configuration or the new one, in the NMT state it was found in, and nothing may be
stored; only where the node stays silent or the bus is dead may the exit code be 7, and then `recover` must bring the
old configuration back. Exits with 1 where any cell is anything else, and names such cells.

--thorough        in each of the four states a device can be found in, not in one by turns
--cells N         about N cells, evenly spread
--only CELL       one cell, as it is named in the table
--processes N     as many at once as there are processors, where it is not given
"""

from __future__ import annotations

import argparse
import gc
import logging
import multiprocessing
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.faults.matrix import NEW, OLD, RECOVERED, TOLD, UNNOTICED, Cell, cells_of, groups, outcome
from tests.faults.sequences import FAULTS, Start

FINE = (OLD, NEW, RECOVERED, TOLD, UNNOTICED)
BAD = "bad"
_SHOWN = 40


def run_group(work: tuple[tuple[str, str, Start], int]) -> list[tuple[Cell, str]]:
    """The outcomes of every *stride*-th cell of one group."""
    group, stride = work
    cells = list(cells_of(*group))[::stride]
    gc.freeze()  # dictionaries stay; looking through them again and again takes a quarter of the time
    gc.set_threshold(50_000, 50, 50)
    return [(cell, outcome(cell)) for cell in cells]


def outcomes(*, thorough: bool, stride: int, processes: int) -> Iterator[tuple[Cell, str]]:
    """Every cell with what became of it."""
    work = [(group, stride) for group in groups(thorough=thorough)]
    work.sort(key=lambda one: one[0][1] != "script")  # the longest first
    if processes == 1:
        for one in work:
            yield from run_group(one)
        return
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for part in pool.imap_unordered(run_group, work):
            yield from part


def table(counts: Counter[tuple[str, str]]) -> Iterator[str]:
    """One line a fault."""
    columns = (*FINE, BAD)
    yield f"{'fault':30}{'cells':>8}" + "".join(f"{column:>20}" for column in columns)
    for fault in (*FAULTS, "all"):
        row = [sum(counts[one, column] for one in FAULTS if fault in (one, "all")) for column in columns]
        yield f"{fault:30}{sum(row):8}" + "".join(f"{number or '-':>20}" for number in row)


def main() -> int:
    """Run the matrix and print it; 1 where a cell is bad."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--thorough", action="store_true")
    parser.add_argument("--cells", type=int)
    parser.add_argument("--only", type=Cell.parse)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    logging.disable(logging.CRITICAL)
    if asked.only:
        result = outcome(asked.only)
        print(f"{asked.only}: {result}")
        return int(result not in FINE)
    stride = 1
    if asked.cells:
        whole = sum(len(list(cells_of(*group))) for group in groups(thorough=asked.thorough))
        stride = max(1, whole // asked.cells)
    started_s = time.monotonic()
    counts: Counter[tuple[str, str]] = Counter()
    bad: list[tuple[Cell, str]] = []
    for cell, result in outcomes(thorough=asked.thorough, stride=stride, processes=asked.processes):
        counts[cell.fault, result if result in FINE else BAD] += 1
        if result not in FINE:
            bad.append((cell, result))
    for line in table(counts):
        print(line)
    whole = counts.total()
    share = 100 * (whole - len(bad)) / whole
    print(f"{whole} cells in {time.monotonic() - started_s:.1f} s, {share:.2f} % as they should be")
    for cell, result in sorted(bad, key=str)[:_SHOWN]:
        print(f"  {cell}: {result}")
    if len(bad) > _SHOWN:
        print(f"  and {len(bad) - _SHOWN} more")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
