"""What somebody called an object in this device is shown beside its name, and typed in its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import small_xdd
from tests.cli.commands.bench import Bench


@pytest.fixture
def named(tmp_path: Path) -> Path:
    """A device whose analogue input somebody called *Tank left*."""
    path = tmp_path / "pump.xdd"
    level = small_xdd.variable(0x2000, "Level", "0006", PDOmapping="TPDO", denotation="Tank left")
    path.write_text(small_xdd.xdd(objects=small_xdd.OBJECTS + level))
    return path


def test_it_is_found_shown_and_taken(named: Path) -> None:
    with Bench((str(named),)) as bench:
        assert "2000:00  Tank left (Level)" in bench.run("objects tank").stdout
        assert "0x2000:00  Tank left (Level) = " in bench.run("read tank_left").stdout
        assert "0x2000:00  Tank left (Level) = " in bench.run("read level").stdout
        assert bench.run('map tpdo1 "Tank left"').code == 0
        assert "Tank left (Level)" in bench.run("pdo tpdo1").stdout
