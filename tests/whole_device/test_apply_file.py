"""`apply`, `plan`, `diff`, `verify` of a file about one device, and `clone`: what differs, nothing that may not be."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands.bench import Bench
from tests.whole_device.test_export_dcf import FAMILIES

CHANGES = ("set tpdo1 --timer 70", "write 1017 700")


def _made(folder: Path, family: str, form: str, *lines: str) -> Path:
    """A file of this *form* of a node that *lines* changed."""
    file = folder / f"node.{form}"
    with Bench((f"{family}@5",)) as bench:
        for line in lines:
            assert bench.run(line).code in (0, 1), line
        assert bench.run(f"{'export' if form == 'dcf' else 'backup'} {file}").code == 0
    return file


@pytest.mark.parametrize("form", ["dcf", "jsonl"])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_fresh_node_becomes_what_the_file_says(family: str, form: str, tmp_path: Path) -> None:
    file = _made(tmp_path, family, form, *CHANGES)
    with Bench((f"{family}@5",)) as bench:
        differs = bench.run(f"diff {file} --json").document["changed"]
        assert bench.run(f"verify {file}").code == (3 if differs else 0)
        applied = bench.run(f"apply {file} --yes --json")
        assert (applied.code, applied.document["changed"]) == (0, differs), applied.stderr
        again = bench.run(f"apply {file} --yes --json")
        assert (again.code, again.document["writes"]) == (0, 0)
        assert bench.run(f"diff {file}").code == 0
        assert bench.run(f"verify {file}").code == 0
        assert bench.run(f"compare {file}").code == 0
