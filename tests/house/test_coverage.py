"""Branches are counted where the tests run, in workers too, also when a variable asks for it, as `.ci/run` does."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.house.coverage import report, rooms
from tests.process import ROOT, environment


@pytest.mark.drawn(0)
def test_an_option_from_a_variable_counts_in_a_worker() -> None:
    one = str(ROOT / "tests" / "domain" / "test_cob_id.py")
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "1", "-p", "no:cacheprovider", one],
        env=environment() | {"PYTEST_ADDOPTS": "--cov=dvtcli.domain --cov-branch --cov-report="},
        capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    found = report()
    gone, run = (found["totals"][key] for key in ("covered_branches", "covered_lines"))
    assert gone > 0, "branches"
    assert run > 0, "lines"
    assert [line.split()[0] for line in rooms(found)] == ["room", "domain", "all"]
