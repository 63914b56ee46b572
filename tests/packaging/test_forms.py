"""dvtcli runs whatever form its package has: a zip file on PYTHONPATH, or compiled files without their sources.

Nothing lists folders or reads sources at run time, and data files are found by `importlib.resources`.
"""

from __future__ import annotations

import compileall
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

from dvtcli.cli.help.guide import TOPICS
from dvtcli.files.user_folders import family_files
from tests.house.source import PACKAGE
from tests.process import environment

#: a command, what it is told on standard input, and what it prints
COMMANDS = (
    ("--help", "", "Change PDOs"),
    ("help dvt", "", "Tcl"),
    ("--sim gen4 pdo", "", "TPDO1"),
    ("--sim gen4 --yes map tpdo3 6041", "", "read back equal"),
    ("--sim gen4 export x.dcf", "", "x.dcf: node 1"),
    ("--sim gen4 report x.html", "", "x.html: sim, 1 node"),
    ("--sim gen4 tour", "\n" * 20, "TPDO1 rolled back"),
)


def _zipped(folder: Path) -> Path:
    archive = folder / "dvtcli.zip"
    with ZipFile(archive, "w", ZIP_DEFLATED) as file:
        for path in sorted(PACKAGE.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                file.write(path, path.relative_to(PACKAGE.parent))
    return archive


def _compiled(folder: Path) -> Path:
    tree = folder / "tree"
    shutil.copytree(PACKAGE, tree / "dvtcli", ignore=shutil.ignore_patterns("__pycache__"))
    assert compileall.compile_dir(tree, quiet=1, legacy=True)
    for source in tree.rglob("*.py"):
        source.unlink()
    return tree


def run(words: list[str], where: Path, command: str, typed: str) -> str:
    """What the program *words* prints for *command* if *where* is what Python finds first."""
    (place := where.parent / "elsewhere").mkdir()
    ran = subprocess.run(
        [*words, *command.split()], cwd=place, input=typed, text=True, capture_output=True, encoding="utf-8",
        env=environment() | {"PYTHONPATH": str(where), "COLUMNS": "120"}, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


every_command = pytest.mark.parametrize(
    ("command", "typed", "printed"), COMMANDS, ids=[command for command, *_ in COMMANDS]
)


@pytest.mark.drawn(2)
@every_command
@pytest.mark.parametrize("form", [_zipped, _compiled], ids=["zip", "compiled"])
def test_a_command_runs(form: Callable[[Path], Path], command: str, typed: str, printed: str, tmp_path: Path) -> None:
    where = form(tmp_path)
    assert printed in run([sys.executable, "-m", "dvtcli"], where, command, typed)
    used = [sys.executable, "-c", "import dvtcli; print(dvtcli.__file__)"]
    found = subprocess.run(
        used, cwd=tmp_path, env=environment() | {"PYTHONPATH": str(where)}, text=True, capture_output=True, check=True
    )
    assert found.stdout.startswith(f"{where}{os.sep}"), found.stdout


@every_command
def test_a_command_of_the_frozen_program_runs(
    command: str, typed: str, printed: str, tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    """`--frozen PROGRAM` names what `scripts/freeze.py` made."""
    if (program := pytestconfig.getoption("--frozen")) is None:
        pytest.skip("--frozen PROGRAM names none")
    assert printed in run([program], tmp_path / "nothing", command, typed)


def test_a_tcl_script_runs_in_the_frozen_program(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    """Its interpreter is a process of its own, of the same program."""
    if (program := pytestconfig.getoption("--frozen")) is None:
        pytest.skip("--frozen PROGRAM names none")
    pytest.importorskip("tkinter", reason="Tcl is in python3-tk")
    script = tmp_path / "a.tcl"
    script.write_text("dvtcli pdo tpdo1\n", encoding="utf-8")
    assert "TPDO1" in run([program], tmp_path / "nothing", f"--sim gen4 run {script}", "")


def test_tables_of_data_files_name_what_is_there() -> None:
    folders = [path for path in (PACKAGE / "families").iterdir() if path.is_dir()]
    families = {folder.name: sorted(file.name for file in folder.iterdir()) for folder in folders}
    assert {name: list(files) for name, files in family_files().items()} == families
    assert list(family_files()) == sorted(family_files())
    assert {path.stem for path in (PACKAGE / "cli" / "help" / "topics").iterdir()} == set(TOPICS)
