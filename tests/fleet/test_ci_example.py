"""The repository of `examples/ci`: its gate and its scenarios hold, and the gate shuts where something is wrong."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.fleet.ansible import BINARIES
from tests.process import PATIENCE_S, Ran, environment
from tests.surroundings import ROOT

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="the gate is a script for bash"),
    pytest.mark.drawn(1, "ci example"),
]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "examples" / "ci", tmp_path / "machine"))


def ran(repository: Path, *command: str, **variables: str) -> Ran:
    path = f"{BINARIES}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        command, cwd=repository, env=environment() | {"PATH": path} | variables, capture_output=True, text=True,
        timeout=PATIENCE_S, check=False,
    )  # fmt: skip


def test_the_gate_is_open(repository: Path) -> None:
    done = ran(repository, "./gate.sh", FORMAT="github", BUS="--sim gen4@1 --sim generic@5")
    assert done.returncode == 3, done.stderr  # what this bench holds are its makers' values
    assert "proved by a restart" in done.stdout
    assert "No difference: every node has the values of the file." in done.stdout


def test_reports_for_other_ci_systems_are_files(repository: Path) -> None:
    done = ran(repository, "./gate.sh", FORMAT="junit")
    assert (done.returncode, "<testsuite" in done.stdout) == (0, False), done.stderr
    reports = {path.name: path.read_text("utf-8") for path in (repository / "reports").iterdir()}
    assert set(reports) == {"check.xml", "rehearsal.xml"}
    for report in reports.values():
        assert "<testcase" in ElementTree.canonicalize(report)
        assert "<failure" not in report


@pytest.mark.quick
def test_the_gate_is_shut_for_a_file_that_is_wrong(repository: Path) -> None:
    file = repository / "network.yaml"
    file.write_text(file.read_text("utf-8").replace("cob_id: 0x185", "cob_id: 0x186"), "utf-8")
    done = ran(repository, "./gate.sh", FORMAT="github")
    assert done.returncode == 4
    assert "rpdo-without-producer" in done.stdout
    assert "file=network.yaml" in done.stdout
    assert "proved" not in done.stdout


def test_the_scenarios_hold(repository: Path) -> None:
    done = ran(repository, sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests")
    assert done.returncode == 0, done.stdout
    assert "2 passed" in done.stdout
