"""A home of one's own for what is remembered of nodes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.surroundings import HOMES


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    from tests.operations.network.test_network_faults import ideal

    for folder in ("ideal", "home"):
        for name in HOMES:
            monkeypatch.setenv(name, str(tmp_path / folder))
        ideal()
    return tmp_path / "home"
