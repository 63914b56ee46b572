"""The packages that are published: wheel and source archive, built twice, and what they need."""

from __future__ import annotations

import ast
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from email.parser import BytesParser
from pathlib import Path
from zipfile import ZipFile

import pytest

from dvtcli import __version__
from tests.documentation.pages import text
from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree, imported
from tests.packaging.lowest import lower_bounds, wanted
from tests.process import ROOT, dvtcli, environment

#: distribution -> the package that it brings, where that has another name
BRINGS = {"python-can": "can", "prompt-toolkit": "prompt_toolkit", "ruamel.yaml": "ruamel"}
#: what a user installs for a task; the other extras are for who works on dvtcli
USERS_EXTRAS = ("dbc", "plot", "mdf", "hex", "parquet")
PROJECT = tomllib.loads(text("pyproject.toml"))["project"]
#: file of the wheel's data folder -> what prints it
SHARED = {
    "share/man/man1/dvtcli.1": ("help", "--man"),
    "share/bash-completion/completions/dvtcli": ("completion", "bash"),
    "share/zsh/site-functions/_dvtcli": ("completion", "zsh"),
    "share/fish/vendor_completions.d/dvtcli.fish": ("completion", "fish"),
    "share/dvtcli/completions/dvtcli.ps1": ("completion", "powershell"),
}


def copied(folder: Path, mode: int) -> Path:
    """A copy of what is published of this checkout in *folder*; its files have *mode*."""
    words = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, check=False)
    if listed.returncode != 0:
        pytest.skip("not a checkout: which files belong to it is not known")
    for name in filter(None, listed.stdout.decode().split("\0")):
        if (source := ROOT / name).is_file():
            (target := folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
            target.chmod(mode)
    return folder


def built(folder: Path, target: str) -> Path:
    """What hatchling builds of the checkout in *folder*: *target* is `wheel` or `sdist`."""
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", "out"],
        cwd=folder, env=environment() | {"DVTCLI_SIM": "nosuch"}, check=True, capture_output=True,
    )  # fmt: skip
    (found,) = (folder / "out").glob("*.whl" if target == "wheel" else "*.tar.gz")
    return found


@pytest.mark.needs("hatchling")
@pytest.mark.long
def test_both_are_equal_however_often_and_wherever_they_are_built(tmp_path: Path) -> None:
    """Also a wheel built from the source archive; settings of whoever builds it say nothing there."""
    one, two = copied(tmp_path / "one", 0o644), copied(tmp_path / "a" / "b", 0o600)
    wheel, archive = built(one, "wheel"), built(one, "sdist")
    assert archive.read_bytes() == built(two, "sdist").read_bytes()
    with tarfile.open(archive) as file:
        file.extractall(tmp_path, filter="data")
    unpacked = tmp_path / f"canopen_dvtcli-{__version__}"
    assert wheel.read_bytes() == built(unpacked, "wheel").read_bytes()
    assert (unpacked / "tests").is_dir()
    assert (unpacked / "LICENSE").is_file()

    with ZipFile(wheel) as packed:
        names = packed.namelist()
        facts = BytesParser().parsebytes(packed.read(f"canopen_dvtcli-{__version__}.dist-info/METADATA"))
        data = f"canopen_dvtcli-{__version__}.data/data/"
        shared = {name.removeprefix(data): packed.read(name).decode() for name in names if name.startswith(data)}
    assert (facts["Name"], facts["Version"]) == ("canopen-dvtcli", __version__)
    in_checkout = {str(path.relative_to(one)) for path in (one / "dvtcli").rglob("*") if path.is_file()}
    assert {name for name in names if name.startswith("dvtcli/")} == in_checkout
    assert shared == {name: dvtcli(*words).stdout for name, words in SHARED.items()}


@pytest.mark.needs("cyclonedx")
@pytest.mark.parametrize("frozen", [False, True], ids=["installed", "frozen"])
def test_the_bill_of_materials_is_cyclonedx_and_names_every_package_that_is_needed(
    frozen: bool, tmp_path: Path
) -> None:
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    write = f"from pathlib import Path; from bill_of_materials import *; write_bill(Path('bill.json'), frozen={frozen})"
    search = environment() | {"PYTHONPATH": str(ROOT / "scripts")}
    subprocess.run([sys.executable, "-c", write], check=True, cwd=tmp_path, env=search)
    bill = (tmp_path / "bill.json").read_text("utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(bill) is None
    named = {component["name"] for component in json.loads(bill)["components"]}
    needed = {re.split(r"[^\w.-]", line)[0].replace(".", "-") for line in PROJECT["dependencies"]}
    assert needed < named, "and what these need"
    assert "pytest" not in named
    assert ("python" in named, "pyserial" in named) == (frozen, frozen)


def test_the_version_stands_in_one_place() -> None:
    assert "version" in PROJECT["dynamic"]
    assert re.search(rf"^## \[{re.escape(__version__)}\]", text("CHANGELOG.md"), re.M)


def test_each_dependency_has_a_lower_bound_and_each_upper_bound_a_reason() -> None:
    assert len(list(lower_bounds(wanted()))) == len(wanted())
    lists = [PROJECT["dependencies"], *PROJECT["optional-dependencies"].values()]
    bounded = {requirement for requirements in lists for requirement in requirements if "<" in requirement}
    assert bounded
    for requirement in bounded:
        assert re.search(rf'"{re.escape(requirement)}",  # \w', text("pyproject.toml")), requirement


@pytest.mark.together
def test_every_dependency_is_imported() -> None:
    """Those of an extra perhaps by their names, when they are needed."""
    tree = SourceTree.of_the_package()
    modules = {name.partition(".")[0] for _, file in tree for node in nodes(file) for name in imported(node)}
    assert {BRINGS.get(name, name) for name in distributions(PROJECT["dependencies"])} <= modules

    words = {node.value for _, file in tree for node in nodes(file) if isinstance(node, ast.Constant)}
    for extra in USERS_EXTRAS:
        assert distributions(PROJECT["optional-dependencies"][extra]) <= modules | words, extra


def distributions(requirements: list[str]) -> set[str]:
    """The names in *requirements*."""
    return {re.split(r"[<>=~! \[]", requirement)[0] for requirement in requirements}
