"""Every reader, the SDO client and server, and the views: as many hostile inputs as `--fuzz` says.

Most are made from a fixed seed, the rest by Hypothesis, which finds the smallest one that fails.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.drive import SHARES, made, run, workshop
from tests.fuzz.grammar import make
from tests.fuzz.targets import TARGETS

SEED = "ci"
#: of twenty inputs, how many Hypothesis makes
SMALLEST = 1


@pytest.fixture(autouse=True)
def in_a_workshop() -> Iterator[Path]:
    with workshop() as folder:
        yield folder


def share(target: str, request: pytest.FixtureRequest) -> int:
    wanted: int = request.config.getoption("--fuzz")
    return wanted * SHARES[target] // 1000


@pytest.mark.long
@pytest.mark.counted
@pytest.mark.parametrize("target", TARGETS)
def test_hostile_input_gets_an_answer_or_an_error_of_ours(target: str, request: pytest.FixtureRequest) -> None:
    count = share(target, request) * (20 - SMALLEST) // 20
    for found in run(target, SEED, range(count)):
        assert found is None, str(found)


@pytest.mark.counted
@pytest.mark.parametrize("target", TARGETS)
def test_hypothesis_finds_no_smallest_input_that_fails(target: str, request: pytest.FixtureRequest) -> None:
    quiet = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]

    @settings(
        max_examples=max(1, share(target, request) * SMALLEST // 20),
        deadline=None,
        derandomize=True,
        suppress_health_check=quiet,
    )
    @given(st.randoms(use_true_random=False))
    def law(random: Random) -> None:
        TARGETS[target](make(target, random))

    law()


@pytest.mark.parametrize("target", TARGETS)
def test_the_same_number_makes_the_same_input(target: str) -> None:
    assert [made(target, SEED, number) for number in range(20)] == [made(target, SEED, number) for number in range(20)]
    assert len({made(target, SEED, number) for number in range(50)}) > 20
