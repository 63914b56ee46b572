"""Branches are counted where the tests run, in workers, too, also when a variable asks for it, as `.ci/run` does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.house.branches import counted, left, rooms
from tests.process import ROOT, environment


@pytest.mark.drawn(0)
def test_an_option_from_a_variable_counts_in_a_worker(tmp_path: Path) -> None:
    one = str(ROOT / "tests" / "domain" / "test_cob_id.py")
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "1", "-p", "no:cacheprovider", one],
        env=environment() | {"PYTEST_ADDOPTS": f"--branches {tmp_path / 'counted'}"},
        capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    files = counted(tmp_path / "counted")
    cob_id = files["domain/cob_id.py"]
    assert cob_id["executed_branches"]
    assert len(list(left(cob_id, "domain/cob_id.py"))) < len(cob_id["executed_lines"]) / 2
    assert not files["cli/commands/map.py"]["executed_lines"], "nobody imported it, and it counts"
    words = [line.split()[0] for line in rooms(files)]
    assert (words[0], words[-1]) == ("room", "all")
    assert {"domain", "cli"} <= set(words)


def test_a_folder_without_counts_says_so(tmp_path: Path) -> None:
    assert list(rooms(counted(tmp_path))) == ["nothing was counted: there is nothing in this folder"]
