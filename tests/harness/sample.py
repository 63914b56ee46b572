"""A part of what is too much for every run: another part in another run, the same one for the same seed.

`pytest --randomly-seed=N`, with the seed that the head of a run prints, takes the same part again; with
`--cases rest` it takes what that part left out, with `--cases more` both. If a folder, a file or a `-k` names tests,
all of their cases run.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import TypeVar

import pytest

from tests.harness.costs import heavy_tests

One = TypeVar("One")

#: so many cases of a test a whole run takes, where the test says nothing else
CASES = 3
#: of what takes much of the processors a whole run takes one of so many that it would take
LESS = 6
#: the lot of the tests of a file that take much and have one case
ALONE = "tests with one case"
#: marks of what takes long, or waits, or needs what few machines have
NOT_QUICK = {"counted", "kernel", "long", "needs", "together", "xfail"}
#: A new test that takes a fifth of a second of processor time or more: a whole run takes some of all of them.
heavy = pytest.mark.drawn(20, "heavy")


def turn(config: pytest.Config) -> int:
    """The seed of this run's order, the same in all of its processes; 0 where the order is not random."""
    seed = config.getoption("randomly_seed", 0)
    return seed if isinstance(seed, int) else 0


def part(everything: Sequence[One], count: int, config: pytest.Config, what: object = "") -> list[One]:
    """*count* of *everything*, in its order; *what* it is of makes one choice independent of another."""
    chosen = random.Random(f"{turn(config)} {what}").sample(range(len(everything)), min(count, len(everything)))
    return [everything[number] for number in sorted(chosen)]


def mark_many(items: Sequence[pytest.Item], much: frozenset[str] | None = None) -> None:
    """A test that has more than CASES of them and says nothing else is `drawn(CASES)`.

    Of those that take *much* of the processors (without: those of `heavy.txt`) a sixth is drawn of what would be, at
    least one: of each test with cases, of each lot with a name, and of the tests of a file that have one case each.
    Not where an option says how many there are, and not of Hypothesis, which is its own lot.
    """
    much = heavy_tests() if much is None else much
    of_test: dict[str, list[pytest.Item]] = defaultdict(list)
    lots: dict[tuple[int, str, bool], list[pytest.Item]] = defaultdict(list)
    for item in items:
        marker = item.get_closest_marker("drawn")
        if marker is not None:
            count, *names = marker.args
            lots[count, names[0] if names else _test_of(item), bool(names)].append(item)
        elif not _is_law(item):
            of_test[_test_of(item)].append(item)
    for test, cases in of_test.items():
        is_counted = "counted" in marks(cases[0])
        if len(cases) > CASES and not is_counted:
            _draw(cases, CASES)
        if len(cases) > 1:
            lots[len(cases) if is_counted else min(CASES, len(cases)), test, is_counted].extend(cases)
        elif test in much:
            lots[0, f"{ALONE} of {test.partition('::')[0]}", True].extend(cases)
    for (usual, name, is_named), cases in lots.items():
        if 2 * sum(_test_of(item) in much for item in cases) > len(cases):
            count = len(cases) if name.startswith(ALONE) else usual
            _draw(cases, ceil(count / LESS), *[name] * is_named)


def _draw(cases: Sequence[pytest.Item], *args: object) -> None:
    """Mark *cases* as `drawn` with *args*, whatever they say themselves."""
    for item in cases:
        item.add_marker(pytest.mark.drawn(*args), append=False)


def _test_of(item: pytest.Item) -> str:
    """Return the node ID of the test that *item* is a case of."""
    return item.nodeid.partition("[")[0]


def marks(item: pytest.Item) -> set[str]:
    """Return the names of the marks of *item*, its class and its file."""
    return {mark.name for mark in item.iter_markers()}


def _is_law(item: pytest.Item) -> bool:
    """Whether Hypothesis draws examples for *item*, which its plugin marks only later."""
    return bool(getattr(getattr(item, "obj", None), "is_hypothesis_test", False))


def mark_quick(items: Sequence[pytest.Item]) -> None:
    """Mark the first test of each file `quick`, unless it takes long, or much if another one does not.

    Other quick tests have the mark themselves.
    """
    much = heavy_tests()
    first: dict[Path, tuple[tuple[bool, int, str], pytest.Item]] = {}
    for item in items:  # they come in a random order
        place = (_test_of(item) in much, _line(item), item.nodeid)
        if (item.path not in first or place < first[item.path][0]) and not _takes_long(item):
            first[item.path] = (place, item)
    for _, item in first.values():
        item.add_marker(pytest.mark.quick)


def _line(item: pytest.Item) -> int:
    """Return the line where the function of *item* begins; `item.location` costs a second for all tests."""
    code = getattr(getattr(item, "function", None), "__code__", None)
    return int(code.co_firstlineno) if code else 0


def _takes_long(item: pytest.Item) -> bool:
    drawn = item.get_closest_marker("drawn")
    starts_processes = drawn is not None and len(drawn.args) > 1  # a lot of several tests: each takes a second, too
    return starts_processes or _is_law(item) or bool(marks(item) & NOT_QUICK)


def left_out(items: Sequence[pytest.Item], config: pytest.Config, wanted: str) -> set[pytest.Item]:
    """Those cases of tests marked `drawn(N)` that do not run: all but N of each test, or, of the `rest`, those N.

    Of the `rest`, only one case in `--share` runs, on average; `more` is the lot and that. With `drawn(N, NAME)` all
    tests of that name are one lot; a whole file may be. None of Hypothesis is in such a lot, and of these what is
    counted runs again with the `rest`, whatever was drawn: `.ci/run` asks for more of both.
    """
    share = config.getoption("share")
    cases: dict[tuple[str, int], list[pytest.Item]] = defaultdict(list)
    for item in items if wanted != "all" else ():
        marker = item.get_closest_marker("drawn")
        if marker is None:
            continue
        count, *name = marker.args
        if not name or not _is_law(item):
            cases[(name or [_test_of(item)])[0], count].append(item)
    out: set[pytest.Item] = set()
    for (test, count), of_test in cases.items():
        of_test.sort(key=lambda item: item.nodeid)
        drawn = lot = set(part(of_test, count, config, test))
        if wanted in ("rest", "more"):
            rest = [item for item in of_test if item not in lot]
            drawn = set(part(rest, share_of(len(rest), share, config, test), config, f"rest of {test}"))
            drawn |= {item for item in of_test if _is_counted_in_all(item)}
        out |= set(of_test) - (drawn | lot if wanted == "more" else drawn)
    return out


def _is_counted_in_all(item: pytest.Item) -> bool:
    """Whether *item* is counted, and one of a lot of several tests: with more counted it is another test."""
    marker = item.get_closest_marker("drawn")
    return marker is not None and len(marker.args) > 1 and "counted" in marks(item)


def share_of(count: int, share: int, config: pytest.Config, test: str) -> int:
    """Return one of *share* of *count*, up or down by lot, so that it is so on average."""
    return int(count / share + random.Random(f"{turn(config)} how many of {test}").random())
