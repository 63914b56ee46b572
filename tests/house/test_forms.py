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
from dvtcli.files.family_folder import FAMILIES
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
    ("--sim gen4 tour", "\n" * 20, "TPDO1 put back"),
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


@pytest.mark.drawn(2)
@pytest.mark.parametrize(("command", "typed", "printed"), COMMANDS, ids=[command for command, *_ in COMMANDS])
@pytest.mark.parametrize("form", [_zipped, _compiled], ids=["zip", "compiled"])
def test_a_command_runs(form: Callable[[Path], Path], command: str, typed: str, printed: str, tmp_path: Path) -> None:
    (place := tmp_path / "elsewhere").mkdir()
    where = form(tmp_path)
    ran = subprocess.run(
        [sys.executable, "-m", "dvtcli", *command.split()], cwd=place, input=typed, text=True, capture_output=True,
        encoding="utf-8", env=environment() | {"PYTHONPATH": str(where), "COLUMNS": "120"}, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert printed in ran.stdout, ran.stdout
    asked = [sys.executable, "-c", "import dvtcli; print(dvtcli.__file__)"]
    env = environment() | {"PYTHONPATH": str(where)}
    used = subprocess.run(asked, cwd=place, env=env, text=True, capture_output=True, check=True).stdout
    assert used.startswith(f"{where}{os.sep}"), used


def test_tables_of_data_files_name_what_is_there() -> None:
    families = {folder.name: {file.name for file in folder.iterdir()} for folder in (PACKAGE / "families").iterdir()}
    assert {name: set(files) for name, files in FAMILIES.items()} == families
    assert list(FAMILIES) == sorted(FAMILIES)
    assert {path.stem for path in (PACKAGE / "cli" / "help" / "topics").iterdir()} == set(TOPICS)
