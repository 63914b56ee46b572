"""Every benchmark that needs no bus and no minutes, as one table, or as JSON; and two such runs compared.

    python -m tests.benchmarks [--rounds N] [--json FILE] [NAME...]
    python -m tests.benchmarks --compare BEFORE.json AFTER.json
    python -m tests.benchmarks --page RUN.json...

NAME chooses of startup, decode, long, eds, files, sdo, requests, watch, writes; --page prints runs as a table for a
page. dvtcli and what it is compared with are measured in turn, so that what else the machine does falls on both; ratios
are those of each round. The bench_*.py files beside this one measure more.
"""

from __future__ import annotations

import argparse
import json
import logging
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from tests.benchmarks import (
    bench_decode,
    bench_eds,
    bench_files,
    bench_long,
    bench_requests,
    bench_sdo,
    bench_startup,
    bench_watch,
    bench_writes,
)
from tests.benchmarks.figures import Figure, as_json, comparison, figures_in, page, table


def writes(_rounds: int) -> Iterator[Figure]:
    """SDO downloads that a change takes: counts, which no second round changes."""
    for change, (own, _), (theirs, _), same in bench_writes.measure():
        against = "canopen PdoMap.save()" + ("" if same else ", other result")
        yield Figure(f"SDO downloads: {change.name}", "", [own], against, [theirs], most=change.fewest / theirs)


FIGURES: dict[str, Callable[[int], Iterator[Figure]]] = {
    "startup": bench_startup.figures,
    "decode": bench_decode.figures,
    "long": bench_long.figures,
    "eds": bench_eds.figures,
    "files": bench_files.figures,
    "sdo": bench_sdo.figures,
    "requests": bench_requests.figures,
    "watch": bench_watch.figures,
    "writes": writes,
}


def measured(names: Sequence[str], rounds: int, found: list[Figure]) -> Iterator[Figure]:
    """The figures of *names*, kept in *found*, too."""
    for name in names:
        for figure in FIGURES[name](rounds):
            found.append(figure)
            yield figure


def main() -> None:
    """Measure and print the table, or compare two runs."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks")
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[[], *FIGURES], help=", ".join(FIGURES))
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("BEFORE", "AFTER"))
    parser.add_argument("--page", type=Path, nargs="+", metavar="RUN")
    options = parser.parse_args()
    if options.page:
        print(*page(json.loads(path.read_text("utf-8")) for path in options.page), sep="\n")
        return
    if options.compare:
        before, after = map(figures_in, options.compare)
        print(*comparison(before, after), sep="\n")
        return
    logging.disable(logging.CRITICAL)
    found: list[Figure] = []
    try:
        for line in table(measured(options.names or list(FIGURES), options.rounds, found)):
            print(line, flush=True)
    finally:
        if options.json:
            options.json.write_text(as_json(found), "utf-8")


if __name__ == "__main__":
    main()
