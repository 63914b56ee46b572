"""Nothing is imported before it is needed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.process import ROOT, environment

pytestmark = pytest.mark.drawn(8, "startup")

HEAVY = ["can", "canopen", "prompt_toolkit", "ruamel", "dvtcli.cli.commands.map", "dvtcli.simulator", "asyncio"]
#: what only lines about nodes need
NODES = ["dvtcli.domain.pdo", "dvtcli.device.change.journal"]
#: what only a change needs
CHANGES = {
    "dvtcli.domain.plan",
    "dvtcli.domain.rules",
    "dvtcli.device.proposal",
    "dvtcli.device.change.transaction",
    "dvtcli.device.change.change_guard",
}
#: what no change of a simulated device needs: it has no journal, and cannot be undone after the program ends
FILES_OF_CHANGES = {"dvtcli.device.change.journal", "dvtcli.device.change.lock", "dvtcli.device.change.undo_plan"}
#: how many kB of our source a line may import, with a little room
MOST = {"--help": 135, "": 255, "read": 980, "pdo": 990, "map": 1275, "plan": 1660}
PROBE = """
import sys
from dvtcli.cli.main import main
try:
    code = main({words!r})
finally:
    print("LOADED", *sys.modules)
sys.exit(code)
"""


def loaded(*words: str, stdin: str = "") -> set[str]:
    """The modules that are imported when dvtcli ends."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE.format(words=list(words))],
        input=stdin, capture_output=True, encoding="utf-8", env=environment(), check=False,
    )  # fmt: skip
    assert done.returncode in (0, 2), done.stderr
    return set(done.stdout.splitlines()[-1].split()[1:])


@pytest.mark.parametrize("words", [["--help"], ["--version"], []], ids=["--help", "--version", "an empty script"])
def test_help_imports_nothing_heavy(words: list[str]) -> None:
    assert not loaded(*words) & set(HEAVY)


@pytest.mark.parametrize("words", ["--help", "--version"])
def test_help_imports_nothing_about_nodes(words: str) -> None:
    assert not loaded(words) & set(NODES)


@pytest.mark.parametrize("words", [["map", "--help"], ["help", "map"], ["nosuch"], ["map", "nonsense"]])
def test_a_commands_help_and_usage_errors_open_no_bus(words: list[str]) -> None:
    assert not loaded(*words) & {"can", "canopen", "prompt_toolkit", "ruamel"}


@pytest.mark.drawn(1)
@pytest.mark.parametrize(
    "words",
    [["--sim", "gen4", "read", "6041"], ["--sim", "gen4", "pdo"], ["--sim", "gen4", "-y", "map", "tpdo3", "6041"],
     ["load", str(ROOT / "examples" / "line.yaml"), "-b", "125000"],
     ["explain", "181#0102", "-d", str(ROOT / "examples" / "line.yaml")]],
    ids=["read", "pdo", "map", "load", "explain"],
)  # fmt: skip
def test_simulated_and_offline_work_needs_no_can_library(words: list[str]) -> None:
    assert not loaded(*words) & {"can", "canopen"}


def test_the_linter_is_imported_by_eds_check_only(tmp_path: Path) -> None:
    shutil.copy(family_eds("gen4"), tmp_path / "own.eds")
    for words in (
        ["--sim", "gen4", "pdo"],
        ["--sim", str(tmp_path / "own.eds"), "pdo"],
        ["eds", "show", str(tmp_path / "own.eds")],
    ):
        linter = {name for name in loaded(*words) if name.startswith(("dvtcli.domain.lint.", "dvtcli.files.eds.lint"))}
        assert not linter
    assert "dvtcli.files.device_lint" in loaded("eds", "check", str(tmp_path / "own.eds"))


def test_a_command_imports_no_prompt_and_no_other_command() -> None:
    modules = loaded("--sim", "gen4", "read", "6041")
    assert not modules & {"prompt_toolkit", "ruamel", "dvtcli.cli.prompt.loop", "dvtcli.cli.scripts.script", "difflib"}
    assert sys.platform != "linux" or "platformdirs" not in modules
    commands = {name.rpartition(".")[2] for name in modules if name.startswith("dvtcli.cli.commands.")}
    assert {name for name in commands if not name.startswith("_")} == {"read"}


PLAN = ["plan", str(ROOT / "examples" / "line.yaml")]


@pytest.mark.drawn(2)
@pytest.mark.parametrize("line", [["--help"], [], ["read", "6041"], ["pdo"], ["map", "tpdo3", "6041"], PLAN], ids=str)
def test_a_line_imports_no_more_than_it_needs(line: list[str]) -> None:
    simulated = ["--sim", "gen4@1", "--sim", "generic@5"] if line == PLAN else ["--sim", "gen4"]
    stdin = "" if line else "# a script without a line\n"
    modules = loaded(*(simulated if line and line != ["--help"] else []), *line, stdin=stdin)
    paths = (ROOT / name.replace(".", "/") for name in modules if name.split(".")[0] == "dvtcli")
    files = [found for path in paths for found in (path.with_suffix(".py"), path / "__init__.py") if found.exists()]
    kilobytes = sum(file.stat().st_size for file in files) / 1000
    assert kilobytes <= MOST[line[0] if line else ""], (round(kilobytes), sorted(modules))
    assert not modules & FILES_OF_CHANGES


@pytest.mark.parametrize("line", [["read", "6041"], ["pdo"]], ids=str)
def test_a_line_that_only_looks_imports_nothing_of_a_change(line: list[str]) -> None:
    modules = loaded("--sim", "gen4", *line)
    assert "dvtcli.device.node" in modules
    assert not modules & CHANGES
