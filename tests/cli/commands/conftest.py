"""The bench of tests about a network file: two nodes, and the file that the test's module says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench(("gen4@1", "tmcm@5"), {"yes": True}) as made:
        yield made


@pytest.fixture
def file(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    path = tmp_path / "net.yaml"
    path.write_text(request.module.FILE)
    return path
