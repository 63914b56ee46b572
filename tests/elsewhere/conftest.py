"""Each of these tests starts Pythons of its own: a part of them by default, another one in each run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.harness.sample import part

_HERE = Path(__file__).parent


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    ours = [item for item in items if item.path.parent == _HERE]
    for item in ours:
        item.add_marker(pytest.mark.counted)
    marks = config.getoption("markexpr")
    if marks == "quick" or (config.args != config.getini("testpaths") and not marks):
        return  # it is one of each file, or somebody asks for them by name
    ours.sort(key=lambda item: item.nodeid)
    kept = part(ours, config.getoption("--elsewhere"), config, "elsewhere")
    left_out = [item for item in ours if item not in kept]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in left_out]
