"""Virtual PDOs in `export` and `import`: what was written plans empty, and brings another node to the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench

TIED = ["vpdo digital-in 1 2121", "vpdo digital-in 3 2122"]
LEFT = ["vpdo digital-in 1 2121", "vpdo digital-in 2 2122", "write 3300:02 0x0000 --as u16 --force"]


def pins(bench: Bench) -> object:
    return bench.run("vpdo --json").document


@pytest.mark.parametrize("before", [[], TIED, ["vpdo digital-in none"], LEFT])
@pytest.mark.parametrize("word", ["export", "import"])
def test_what_was_written_plans_empty(before: list[str], word: str, tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    with Bench(("gen4@1",), {"yes": True}) as bench:
        for line in before:
            bench.run(line)
        assert bench.run(f"{word} {file}").code == 0
        assert bench.run(f"check {file}").code == 0
        assert bench.run(f"diff {file}").code == 0
        held = pins(bench)
    if before is TIED:
        assert "vpdo:" in file.read_text()
        with Bench(("gen4@1",), {"yes": True}) as bench:
            assert pins(bench) != held
            assert bench.run(f"apply {file}").code == 0
            assert pins(bench) == held
