"""Every benchmark as one table: `python tests/benchmarks/run_all.py [ROUNDS]`.

Each row is measured against what it is compared with, in interleaved rounds on this machine; ratios are medians of the
rounds' ratios. Times depend on the machine, ratios much less. The bench_*.py files beside this one say more.
"""

from __future__ import annotations

import logging
import platform
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.benchmarks import bench_eds, bench_sdo, bench_startup, bench_writes

#: what, ours, the other's, ratio, goal, whether the goal is met
Row = tuple[str, str, str, str, str, bool | None]


def startup(rounds: int) -> Iterator[Row]:
    times = bench_startup.measure(rounds)
    for column, (name, _, goal) in enumerate(bench_startup.ROWS):
        if goal is not None:
            own, other = (1000 * median(row[at] for row in times) for at in (column, column - 1))
            ratio = median(row[column] / row[column - 1] for row in times)
            yield (
                name,
                f"{own:.0f} ms",
                f"{other:.0f} ms {bench_startup.ROWS[column - 1][0]}",
                f"{ratio:.2f}",
                (f"<= {goal}"),
                ratio <= goal,
            )


def round_trips(rounds: int) -> Iterator[Row]:
    server = bench_sdo.Server()
    server.start()
    results = [(bench_sdo.rates(bench_sdo.ours, 1000), bench_sdo.rates(bench_sdo.stock, 1000)) for _ in range(rounds)]
    server.stopping = True
    server.join()
    server.bus.shutdown()
    for number, name in enumerate(("uploads", "downloads")):
        own, other = (median(pair[side][number] for pair in results) for side in (0, 1))
        ratio = median(ours[number] / theirs[number] for ours, theirs in results)
        yield (
            f"SDO {name} a second",
            f"{own:.0f}",
            f"{other:.0f} canopen's client",
            f"{ratio:.2f}",
            ">= 1.0",
            ratio >= 1,
        )


def reading(rounds: int) -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.eds"
        path.write_text(bench_eds.make_eds(), encoding="utf-8")
        times = bench_eds.measure(path, rounds)
    base = times["canopen import_od"]
    for name, goal in (("ours, one object looked at", 15), ("ours, every object built", 0)):
        ratio = median(slow / own for slow, own in zip(base, times[name], strict=True))
        own, other = (f"{1000 * median(seconds):.0f} ms" for seconds in (times[name], base))
        what = f"EDS of {bench_eds.OBJECTS} objects, {name[6:]}"
        yield what, own, f"{other} canopen import_od", f"{ratio:.1f}", f">= {goal}" if goal else "", ratio >= goal


def writes() -> Iterator[Row]:
    for change, (own, _), (their, _), same in bench_writes.measure():
        other = f"{their} canopen PdoMap.save()" + ("" if same else ", other result")
        yield (
            f"SDO downloads: {change.name}",
            str(own),
            other,
            f"{own}/{their}",
            f"= {change.fewest}",
            own == change.fewest,
        )


def main(rounds: int = 7) -> None:
    """Measure everything and print the table."""
    logging.disable(logging.CRITICAL)
    print(f"Python {platform.python_version()} on {platform.system()} {platform.machine()}, {rounds} rounds")
    print(f"{'':46}{'dvtcli':>8}  {'compared with':32}{'ratio':>6}  {'goal':8}")
    for what, own, other, ratio, goal, met in (*startup(rounds), *writes(), *round_trips(rounds), *reading(rounds)):
        print(f"{what:46}{own:>8}  {other:32}{ratio:>6}  {goal:8}{'' if met else 'MISSED'}".rstrip())


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
