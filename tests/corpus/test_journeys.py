"""Files with planted oddities go the whole way; nothing on it is wrong. `pytest --oddities N` takes N files."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.corpus.journey import travel
from tests.corpus.oddities import ODDITIES, OddFile, odd_files
from tests.harness.sample import heavy, turn

#: Of all ways to change a PDO, each one is taken on every so many PDOs.
SHARE = 5


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "file" not in metafunc.fixturenames:
        return
    count = metafunc.config.getoption("--oddities")
    every = odd_files(max(count, len(ODDITIES)))
    first = turn(metafunc.config) % len(every)
    chosen = [*every, *every][first : first + count]
    metafunc.parametrize("file", chosen, ids=[file.name for file in chosen])


@heavy
def test_nothing_goes_wrong(file: OddFile) -> None:
    journey = travel(file.write(Path.cwd()), SHARE)
    assert not journey.wrong, file.planted
    assert journey.outcomes[-1].step != "eds check", "it came to its end"


@heavy
def test_the_same_seed_makes_the_same_files() -> None:
    assert odd_files(len(ODDITIES) + 5, seed=3) == odd_files(len(ODDITIES) + 5, seed=3)
    assert odd_files(3, seed=3) != odd_files(3, seed=4)


def test_each_oddity_is_planted_alone_once() -> None:
    files = odd_files(len(ODDITIES) + 10)
    assert [file.planted for file in files[: len(ODDITIES)]] == [(name,) for name in ODDITIES]
    assert len({file.text for file in files}) == len(files)
