"""What an enabled RPDO takes is process data, whatever the file says of PDOMapping: no store stumbles over it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.small_eds import U16, mapping, plain, var


@pytest.mark.parametrize("keys", [{}, {"PDOMapping": 0}, {"PDOMapping": 1}])
@pytest.mark.parametrize("access", ["rw", "rww"])
def test_what_an_enabled_rpdo_took_since_a_write_forbids_no_store(
    keys: dict[str, int], access: str, tmp_path: Path
) -> None:
    eds = plain()
    one = var("Target velocity", U16, 0, access)
    del one["PDOMapping"]
    eds.variable(0x2008, {**one, **keys})
    eds.record(0x1600, "Mapping 1", mapping(1, [0x20080010, 0, 0, 0]))
    (tmp_path / "w0.eds").write_text(eds.text(), "utf-8")
    with Bench((f"{tmp_path / 'w0.eds'}@5",), {"yes": True}) as bench:
        for line in ("write 2008 5", "nmt start", "send 205#0900", "nmt preop"):
            assert bench.run(line).code == 0, line
        assert bench.run("read 2008 --json").document["value"] == 9, "the RPDO took it"
        stored = bench.run("store")
        assert stored.code == 0, stored.stderr
