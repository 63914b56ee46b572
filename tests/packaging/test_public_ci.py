"""Public CI's file is YAML that names README's commands, each supported Python and rooms that there are."""

from __future__ import annotations

import re
from typing import Any

import pytest
from ruamel.yaml import YAML

from tests.documentation.pages import text
from tests.surroundings import ROOT

COMMANDS = re.findall(r"^```sh\n([^\n]*)\n```$", text("README.md"), re.M)[:2]


@pytest.fixture(scope="module")
def jobs() -> dict[str, Any]:
    document = YAML(typ="safe").load(ROOT / ".github/workflows/ci.yml")
    assert set(document) == {"name", "on", "permissions", "jobs"}
    assert document["permissions"] == {"contents": "read"}
    found: dict[str, Any] = document["jobs"]
    return found


def steps(jobs: dict[str, Any], windows: bool) -> list[str]:
    """The commands of a system's tests."""
    condition = f"runner.os {'==' if windows else '!='} 'Windows'"
    return [step["run"] for step in jobs["tests"]["steps"] if step.get("if") == condition]


def test_it_runs_readmes_commands(jobs: dict[str, Any]) -> None:
    assert steps(jobs, windows=False) == COMMANDS
    there = [command.replace("python3", "python").replace(".venv/bin/", ".venv/Scripts/") for command in COMMANDS]
    first, second = steps(jobs, windows=True)
    assert first == there[0]
    assert second.startswith(f"{there[1]} ")
    for room in second.removeprefix(there[1]).split():
        assert (ROOT / room.removeprefix("--ignore=")).is_dir(), room


def test_it_runs_each_system_and_python_that_is_supported(jobs: dict[str, Any]) -> None:
    matrix = jobs["tests"]["strategy"]["matrix"]
    assert matrix["os"] == ["ubuntu-latest", "macos-latest", "windows-latest"]
    assert all(isinstance(version, str) for version in matrix["python"]), "3.10 would be the number 3.1"
    oldest = re.search(r'requires-python = ">=([\d.]+)"', text("pyproject.toml"))
    assert oldest is not None
    assert matrix["python"][0] == oldest[1]
    assert [version.split(".") for version in matrix["python"]] == [["3", str(minor)] for minor in range(11, 15)]
    named = re.findall(r'"Programming Language :: Python :: (3\.\d+)"', text("pyproject.toml"))
    assert set(named) <= set(matrix["python"])


def test_types_are_looked_at_for_each_system(jobs: dict[str, Any]) -> None:
    assert jobs["types"]["strategy"]["matrix"]["platform"] == ["linux", "darwin", "win32"]
    assert any(
        "mypy --strict --platform ${{ matrix.platform }}" in step.get("run", "") for step in jobs["types"]["steps"]
    )
    own = text(".ci/run")
    assert all(f"--platform {name}" in own for name in ("win32", "darwin"))
