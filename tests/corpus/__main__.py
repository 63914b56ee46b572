"""`python -m tests.corpus FOLDER… [--oddities N] [--seed S] [--share N] [-v]`: files on their way through the tool.

Prints right, refused and wrong for each file and in all; ends with 1 where anything was wrong. Folders are only read.
With `--round-trips` they are written as EDS and XDD, and those as each other, instead, the files of the families, too.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from dvtcli.files.device_file import DEVICE_SUFFIXES
from tests.corpus.journey import REFUSED, RIGHT, WRONG, Journey, travel
from tests.corpus.oddities import odd_files
from tests.corpus.round_trips import report
from tests.house.source import PACKAGE
from tests.surroundings import own_ground, own_place

FAMILIES = PACKAGE / "families"


def main() -> int:
    """Run it."""
    asked = _asked()
    total = dict.fromkeys((RIGHT, REFUSED, WRONG), 0)
    folders = [Path(folder).resolve() for folder in asked.folders]
    files = 0
    if asked.round_trips:
        with tempfile.TemporaryDirectory() as ground:
            odd = [path for path, _ in _odd(Path(ground), asked.oddities, asked.seed)]
            real = [path for path, _ in _real(folders)]
            return 1 if report([*sorted(FAMILIES.glob("*/*.eds")), *real, *odd]) else 0
    with tempfile.TemporaryDirectory() as ground, own_place(own_ground(Path(ground)) / "place"):
        for path, planted in [*_real(folders), *_odd(Path(ground), asked.oddities, asked.seed)]:
            journey = travel(path, asked.share)
            files += 1
            for verdict in total:
                total[verdict] += journey.count(verdict)
            _tell(journey, planted, verbose=asked.v)
    print(f"{files} files: " + ", ".join(f"{count} {verdict}" for verdict, count in total.items()))
    return 1 if total[WRONG] or not files else 0


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.corpus", description=__doc__)
    parser.add_argument("folders", nargs="*", metavar="FOLDER")
    parser.add_argument("--oddities", type=int, default=0, metavar="N", help="generated files besides [0]")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the generated files [0]")
    parser.add_argument("--share", type=int, default=1, metavar="N", help="each PDO in one of N of all ways [1]")
    parser.add_argument("--round-trips", action="store_true", help="write each as EDS and XDD, and read that")
    parser.add_argument("-v", action="store_true", help="each step")
    return parser.parse_args()


def _real(folders: list[Path]) -> Iterator[tuple[Path, str]]:
    for folder in folders:
        found = [folder] if folder.is_file() else sorted(folder.iterdir())
        yield from ((path, "") for path in found if path.suffix.lower() in DEVICE_SUFFIXES)


def _odd(ground: Path, count: int, seed: int) -> Iterator[tuple[Path, str]]:
    for file in odd_files(count, seed):
        yield file.write(ground), ", ".join(file.planted)


def _tell(journey: Journey, planted: str, *, verbose: bool) -> None:
    counts = " ".join(f"{journey.count(verdict):4} {verdict}" for verdict in (RIGHT, REFUSED, WRONG))
    print(f"{journey.path.name:42} {counts}  {planted}".rstrip(), flush=True)
    for outcome in journey.outcomes if verbose else journey.wrong:
        print(f"    {outcome.verdict:8} {outcome.step}: {outcome.why}")


if __name__ == "__main__":
    sys.exit(main())
