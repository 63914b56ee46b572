"""A part of what is too much for every run: another part in another run, the same one for the same seed.

`pytest --randomly-seed=N`, with the seed that the head of a run prints, takes the same part again.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import TypeVar

import pytest

One = TypeVar("One")


def turn(config: pytest.Config) -> int:
    """The seed of this run's order, the same in all of its processes; 0 where the order is not random."""
    seed = config.getoption("randomly_seed", 0)
    return seed if isinstance(seed, int) else 0


def part(everything: Sequence[One], count: int, config: pytest.Config, what: object = "") -> list[One]:
    """*count* of *everything*, in its order; *what* it is of makes one choice independent of another."""
    chosen = random.Random(f"{turn(config)} {what}").sample(range(len(everything)), min(count, len(everything)))
    return [everything[number] for number in sorted(chosen)]
