"""A home of one's own for what is remembered of nodes."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    from tests.network.test_network_faults import ideal

    for folder in ("ideal", "home"):
        for name in ("HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME"):
            monkeypatch.setenv(name, str(tmp_path / folder))
        ideal()
    return tmp_path / "home"
