"""The roles of the Ansible collection, on this machine's files below a folder of the test, and ansible-lint."""

from __future__ import annotations

import base64
import hashlib
import json
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

from tests.fleet.ansible import BINARIES, Fleet
from tests.fleet.test_ansible import NETWORK, NODES, by_lot, doc, held, task
from tests.process import PATIENCE_S, environment
from tests.simulator.serve.served import Served, served
from tests.surroundings import ROOT

pytestmark = pytest.mark.needs("ansible.release")


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    (tmp_path / "network.yaml").write_text(NETWORK, "utf-8")
    return Fleet(tmp_path)


def bench(fleet: Fleet, name: str, one: Served | None, **more: object) -> Path:
    """Add a host for the role `bench`, which has its files and its folder of PATH below the test's folder."""
    home = fleet.folder / name
    words = {
        "bench_home": str(home),
        "bench_package": "",
        "bench_file": str(fleet.folder / "network.yaml"),
        "bench_link": str(home / "bin" / "dvtcli"),
        "bench_bus": "{{ canopen_bus }}",
    }
    fleet.host(name, one, **{**words, **more})
    return home


def installed(home: Path) -> None:
    """Let dvtcli be where the role would have installed it."""
    (home / "venv" / "bin").mkdir(parents=True)
    (home / "venv" / "bin" / "dvtcli").symlink_to(BINARIES / "dvtcli")


@pytest.mark.long
@by_lot
def test_the_role_of_a_bench(fleet: Fleet) -> None:
    with served(fleet.folder, *NODES) as one:
        installed(bench(fleet, "bench", one))
        played = fleet.play([], roles=("dvtcli.canopen.bench",))
        assert played.code == 0, played.said
        assert not held(one)["changed"]
        again = fleet.play([], roles=("dvtcli.canopen.bench",))
        assert not again.hosts("changed"), again.said


@pytest.mark.long
@by_lot
def test_check_mode_plans_the_file_that_would_be_copied_and_ends_well_on_a_fresh_host(fleet: Fleet) -> None:
    """One host has an old file and nodes that are as it says, one has the new file, one has nothing."""
    with served(fleet.folder, *NODES) as old, served(fleet.folder, *NODES) as new:
        for name, one in (("old", old), ("new", new)):
            installed(bench(fleet, name, one))
        assert fleet.play([], roles=("dvtcli.canopen.bench",)).code == 0
        (fleet.folder / "network.yaml").write_text(NETWORK.replace("event_timer: 20", "event_timer: 40"), "utf-8")
        assert fleet.play([], "--limit", "new", roles=("dvtcli.canopen.bench",)).code == 0
        fresh = bench(fleet, "fresh", None, bench_package="canopen-dvtcli")
        before = sorted((fleet.folder / "old").rglob("*"))
        checked = fleet.play([], "--check", "--diff", roles=("dvtcli.canopen.bench",))
        assert checked.code == 0, checked.said
        assert checked.hosts("changed") == {"old", "fresh"}
        assert "-node 1 tpdo1 event_timer: 20" in checked.said
        assert "+node 1 tpdo1 event_timer: 40" in checked.said
        assert f"canopen-dvtcli would be installed in {fresh}/venv" in checked.said
        assert not fresh.exists()
        assert sorted((fleet.folder / "old").rglob("*")) == before
        assert held(old)["changed"]


def wheels(folder: Path) -> None:
    """Make wheels of this program and of what it needs, out of what is installed here."""
    folder.mkdir()
    wanted, made = ["canopen-dvtcli"], set()
    from packaging.requirements import Requirement

    while wanted:
        name = wanted.pop()
        if name.lower() in made:
            continue
        made.add(name.lower())
        found = metadata.distribution(name)
        for text in found.requires or ():
            needed = Requirement(text)
            if needed.marker is None or needed.marker.evaluate({"extra": ""}):
                wanted.append(needed.name)
        wheel(found, folder)


def wheel(found: metadata.Distribution, folder: Path) -> None:
    """Pack an installed distribution again."""
    title = f"{found.metadata['Name'].replace('-', '_')}-{found.version}"
    packed = {name: data for name, data in content(found) if not name.endswith("/RECORD")}
    is_pure = "Root-Is-Purelib: true" in (found.read_text("WHEEL") or "")
    tag = (
        "py3-none-any"
        if is_pure
        else next(
            line.partition(": ")[2]
            for line in (found.read_text("WHEEL") or "").splitlines()
            if line.startswith("Tag: ")
        )
    )
    record = "".join(f"{name},{digest(data)},{len(data)}\n" for name, data in packed.items())
    (info,) = {name.partition("/")[0] for name in packed if name.partition("/")[0].endswith(".dist-info")}
    with zipfile.ZipFile(folder / f"{title}-{tag}.whl", "w") as archive:
        for name, data in [*packed.items(), (f"{info}/RECORD", f"{record}{info}/RECORD,,\n".encode())]:
            archive.writestr(name, data)


def content(found: metadata.Distribution) -> Iterator[tuple[str, bytes]]:
    """Each file of an installed distribution, by its name in a wheel; of this program, its source."""
    for file in found.files or ():
        name = str(file)
        is_ours = found.metadata["Name"] == "canopen-dvtcli" and ".dist-info/" not in name
        if not (name.startswith("..") or name.endswith(".pyc") or is_ours or "direct_url" in name):
            yield name, Path(str(file.locate())).read_bytes()
    if found.metadata["Name"] == "canopen-dvtcli":
        for path in sorted((ROOT / "dvtcli").rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                yield path.relative_to(ROOT).as_posix(), path.read_bytes()


def digest(data: bytes) -> str:
    """How a RECORD writes it."""
    return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


@pytest.mark.long
@by_lot
def test_dvtcli_is_installed_from_a_folder_of_wheels_once_and_found_by_modules(fleet: Fleet) -> None:
    wheels(fleet.folder / "wheels")
    with served(fleet.folder, *NODES) as one:
        home = bench(fleet, "bench", one, bench_package="canopen-dvtcli", bench_wheels=str(fleet.folder / "wheels"))
        (fleet.folder / "path").mkdir()
        fleet.hosts["bench"]["bench_link"] = str(fleet.folder / "path" / "dvtcli")
        played = fleet.play([], roles=("dvtcli.canopen.bench",))
        assert played.code == 0, played.said[-3000:]
        assert not held(one)["changed"]
        program = (home / "venv" / "bin" / "dvtcli").read_text("utf-8")
        assert str(home) in program.splitlines()[0]
        again = fleet.play([], roles=("dvtcli.canopen.bench",))
        assert (again.code, again.hosts("changed")) == (0, set()), again.said[-3000:]
        alone = {**task(fleet, "nodes_facts"), "environment": {"PATH": f"{fleet.folder}/path:/usr/bin:/bin"}}
        assert fleet.play([alone]).code == 0


# --- the role of a gateway


@pytest.mark.long
@by_lot
@pytest.mark.parametrize(
    ("there", "file", "line"),
    [
        (("systemd/network",), "systemd/network/80-can0.network", "BitRate=250000\nRestartSec=100ms\n"),
        ((), "systemd/network/80-can0.network", "BitRate=250000\nRestartSec=100ms\n"),
        (("network/interfaces.d",), "network/interfaces.d/can0", "type can bitrate 250000 restart-ms 100\n"),
    ],
)
def test_the_role_of_a_gateway_writes_what_brings_the_link_up(
    fleet: Fleet, there: tuple[str, ...], file: str, line: str
) -> None:
    etc = fleet.folder / "etc"
    for folder in ("", *there):
        (etc / folder).mkdir(parents=True, exist_ok=True)
    fleet.host("gateway", None, gateway_etc=str(etc), gateway_bitrate=250000, gateway_restart_ms=100)
    checked = fleet.play([], "--check", roles=("dvtcli.canopen.gateway",))
    assert (checked.code, checked.hosts("changed")) == (0, {"gateway"}), checked.said
    assert not (etc / file).exists()
    played = fleet.play([], roles=("dvtcli.canopen.gateway",))
    assert played.code == 0, played.said
    assert line in (etc / file).read_text("utf-8")
    assert "channel = can0\nbitrate = 250000\n" in (etc / "can.conf").read_text("utf-8")
    assert not fleet.play([], roles=("dvtcli.canopen.gateway",)).hosts("changed")


# --- what is said of them


@by_lot
@pytest.mark.parametrize("role", ["bench", "gateway"])
def test_each_role_documents_every_variable(fleet: Fleet, role: str) -> None:
    documented = json.loads(doc(fleet, "-t", "role", f"dvtcli.canopen.{role}"))[f"dvtcli.canopen.{role}"]
    defaults = (ROOT / "ansible" / "roles" / role / "defaults" / "main.yml").read_text("utf-8").splitlines()
    variables = {line.partition(":")[0] for line in defaults if line.startswith(f"{role}_")}
    assert set(documented["entry_points"]["main"]["options"]) == variables


@pytest.mark.long
@by_lot
@pytest.mark.needs("ansiblelint")
def test_ansible_lint_finds_nothing_of_its_production_profile(fleet: Fleet) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "ansiblelint", "--offline", "--nocolor", "--profile", "production", "ansible/"],
        env=environment() | fleet.settings(),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S * 4,
        cwd=ROOT,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "Profile 'production' was required, and it passed" in ran.stdout + ran.stderr
