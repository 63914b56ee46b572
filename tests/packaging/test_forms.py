"""dvtcli runs whatever form its package has: a zip file on PYTHONPATH, or compiled files without their sources.

Nothing lists folders or reads sources at run time, and data files are found by `importlib.resources`.
"""

from __future__ import annotations

import ast
import compileall
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

from dvtcli.cli.commands.help import TOPICS
from dvtcli.files.user_folders import family_files
from dvtcli.interpreter import AS_PYTHON
from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree, imported
from tests.house.source import PACKAGE
from tests.posix import needs_shell
from tests.process import environment
from tests.surroundings import ROOT

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


@pytest.fixture
def frozen(pytestconfig: pytest.Config) -> str:
    """What `scripts/freeze.py` made, as `--frozen PROGRAM` names it."""
    if (program := pytestconfig.getoption("--frozen")) is None:
        pytest.skip("--frozen PROGRAM names none")
    return str(Path(program).resolve())


@every_command
def test_a_command_of_the_frozen_program_runs(
    command: str, typed: str, printed: str, tmp_path: Path, frozen: str
) -> None:
    assert printed in run([frozen], tmp_path / "nothing", command, typed)


def test_a_tcl_script_runs_in_the_frozen_program(tmp_path: Path, frozen: str) -> None:
    """Its interpreter is a process of its own, of the same program."""
    pytest.importorskip("tkinter", reason="Tcl is in python3-tk")
    script = tmp_path / "a.tcl"
    script.write_text("dvtcli pdo tpdo1\n", encoding="utf-8")
    assert "TPDO1" in run([frozen], tmp_path / "nothing", f"--sim gen4 run {script}", "")


def as_python(frozen: str, code: str, **variables: str) -> str:
    """What *code* prints in the Python of the program *frozen*."""
    words = [frozen, AS_PYTHON, "-c", code]
    return subprocess.run(words, env=environment() | variables, text=True, capture_output=True, check=True).stdout


def test_the_frozen_program_imports_little_before_dvtcli(frozen: str) -> None:
    """Each of these takes a tenth of dvtcli's own start, or more."""
    imported = set(as_python(frozen, "import sys; print(*sys.modules)").split())
    slow = {"inspect", "zipfile", "pkgutil", "multiprocessing", "subprocess", "tempfile", "pathlib", "usb"}
    assert imported & slow == set()


@pytest.mark.skipif(sys.platform != "linux", reason="only on Linux a variable names the program's libraries")
def test_programs_that_the_frozen_one_starts_have_the_users_libraries(frozen: str) -> None:
    code = "from dvtcli.interpreter import changed_variables; print(changed_variables())"
    again = f"import subprocess; subprocess.run([{frozen!r}, {AS_PYTHON!r}, '-c', {code!r}], check=True)"
    for started in (code, again):
        assert as_python(frozen, started).strip() == str({"LD_LIBRARY_PATH": ""})
        assert as_python(frozen, started, LD_LIBRARY_PATH="/a:/b").strip() == str({"LD_LIBRARY_PATH": "/a:/b"})


def test_the_frozen_program_finds_its_libraries_in_each_of_its_processes(frozen: str) -> None:
    code = "import sys, os; print(sys._MEIPASS in os.environ.get('LD_LIBRARY_PATH', '').split(':'))"
    again = f"import subprocess; subprocess.run([{frozen!r}, {AS_PYTHON!r}, '-c', {code!r}], check=True)"
    assert [as_python(frozen, started).strip() for started in (code, again)] == [str(sys.platform == "linux")] * 2


def test_doctor_of_the_frozen_program_says_what_is_missing_and_names_no_pip(tmp_path: Path, frozen: str) -> None:
    told = json.loads(run([frozen], tmp_path / "nothing", "--sim gen4 --json doctor", ""))
    (drivers,) = [check["text"] for check in told["checks"] if check["check"] == "drivers"]
    assert "pip install" not in drivers
    assert "dynlib" not in drivers, "these are words of the frozen program's loader"
    ready = drivers.partition("ready: ")[2].partition(";")[0]
    assert "slcan" in ready, "pyserial is included"


def test_the_frozen_folder_lists_each_package_in_it(frozen: str) -> None:
    if not (folder := Path(frozen).parent / "_internal").is_dir():
        pytest.skip("it is one file")
    bill = json.loads((folder.parent / "sbom.cdx.json").read_text("utf-8"))
    named = {component["name"] for component in bill["components"]}
    assert {"python", "pyserial", "gs-usb", "pyusb"} <= named
    there = {path.name.partition("-")[0] for path in folder.glob("*.dist-info")} - {"canopen_dvtcli"}
    assert {re.sub(r"[-_.]+", "-", name).lower() for name in there} <= named


@needs_shell
def test_a_program_of_the_user_gets_the_users_variables_from_a_frozen_one() -> None:
    code = (
        "import sys; sys.frozen = True; from dvtcli.cli.prompt.line import _started; "
        "program = _started(['env']); program.stdin.close(); sys.exit(program.wait())"
    )
    for variables, expected in (
        ({"LD_LIBRARY_PATH": "/own:/users", "LD_LIBRARY_PATH_ORIG": "/users"}, ["LD_LIBRARY_PATH=/users"]),
        ({"LD_LIBRARY_PATH": "/own"}, ["LD_LIBRARY_PATH="]),
        ({}, []),
    ):
        told = subprocess.run(
            [sys.executable, "-c", code], env=environment() | variables, text=True, capture_output=True, check=True
        )
        assert [line for line in told.stdout.splitlines() if line.startswith("LD_LIBRARY_PATH=")] == expected


def test_a_frozen_program_names_no_pip_for_what_it_lacks() -> None:
    code = "import sys; from dvtcli.interpreter import how_to_install as how; print(how('a[b]')); "
    told = subprocess.run(
        [sys.executable, "-c", f"{code} sys.frozen = True; print(how('a[b]'))"],
        env=environment(), text=True, capture_output=True, check=True,
    )  # fmt: skip
    installed, frozen = told.stdout.splitlines()
    assert installed == "pip install 'a[b]'"
    assert frozen.startswith("this program was made without a[b]: ")


@pytest.mark.together
def test_what_is_left_out_of_the_frozen_program_is_never_imported() -> None:
    recipe = ast.parse((ROOT / "scripts/frozen/dvtcli.spec").read_text("utf-8"))
    (left_out,) = [
        set(ast.literal_eval(line.value))
        for line in recipe.body
        if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) == "LEFT_OUT"
    ]
    modules = {name for _, tree in SourceTree.of_the_package() for node in nodes(tree) for name in imported(node)}
    assert left_out
    assert left_out & {name.partition(".")[0] for name in modules} == set()


def test_tables_of_data_files_name_what_is_there() -> None:
    folders = [path for path in (PACKAGE / "families").iterdir() if path.is_dir()]
    families = {folder.name: sorted(file.name for file in folder.iterdir()) for folder in folders}
    assert {name: list(files) for name, files in family_files().items()} == families
    assert list(family_files()) == sorted(family_files())
    assert {path.stem for path in (PACKAGE / "cli" / "help" / "topics").iterdir()} == set(TOPICS)
