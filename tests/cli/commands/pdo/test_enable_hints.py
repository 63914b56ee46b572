"""The hint of a refused `enable` or `write` names options of its own command only."""

from __future__ import annotations

import pytest

from tests.cli.commands.bench import Bench


@pytest.mark.parametrize("line", ["enable tpdo3", "write 1802:1 0x381"])
def test_an_empty_pdo_is_not_to_be_left_off_by_a_command_that_enables_it(line: str) -> None:
    with Bench() as bench:
        ran = bench.run(line)
        assert ran.code == 1
        (hint,) = (row for row in ran.stderr.splitlines() if row.startswith("  hint"))
        assert "map tpdo3 OBJECT…" in hint
        assert "--off" not in hint
