"""Which cases of `learn` a run takes: as many as `--learn N` says, by the run's seed."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from tests.harness.sample import part


def some(metafunc: pytest.Metafunc, names: str, cells: Sequence[object], share: float = 1) -> None:
    """Give the test that has all of *names* N times *share* of *cells*, at least one."""
    if not set(names.split(",")) <= set(metafunc.fixturenames):
        return
    count = max(1, int(share * metafunc.config.getoption("--learn")))
    taken = part(cells, count, metafunc.config, metafunc.definition.nodeid)
    metafunc.parametrize(names.split(",") if "," in names else names, taken)
