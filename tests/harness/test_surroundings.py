"""Who runs the tests, where, and with which files lying about changes nothing of them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from platformdirs import user_cache_dir, user_config_dir, user_data_dir, user_state_dir

from tests.cli.commands.bench import Bench
from tests.process import dvtcli, environment
from tests.surroundings import Places

STRAY = 'sim = ["no-such-family"]\ntimeout = -1\n'
#: wishes of whoever runs the tests, each of which dvtcli, Python, python-can or a terminal program would follow
WISHES = {
    "DVTCLI_SIM": "no-such-family",
    "DVTCLI_CONFIG": "/nowhere/at.all",
    "CAN_INTERFACE": "no-such-interface",
    "COLUMNS": "31",
    "NO_COLOR": "1",
    "FORCE_COLOR": "1",
    "PYTHONOPTIMIZE": "2",
    "PYTHONDONTWRITEBYTECODE": "1",
    "XDG_STATE_HOME": "/nowhere/state",
    "SUDO_UID": "12345",
}


def test_a_test_has_a_home_and_a_folder_of_its_own() -> None:
    home, work = Path(os.environ["HOME"]), Path.cwd()
    assert home.parent == work.parent
    assert list(home.iterdir()) == []
    assert {path.name for path in work.iterdir()} == {"scripts", "tests"}
    for folder in (user_config_dir, user_state_dir, user_data_dir, user_cache_dir):
        assert Path(folder("dvtcli")).is_relative_to(home)
    assert Path(environment()["HOME"]) == home


@pytest.mark.parametrize("again", [1, 2])
def test_what_a_test_leaves_behind_no_other_finds(again: int) -> None:
    test_a_test_has_a_home_and_a_folder_of_its_own()
    Path("left").touch()
    (Path.home() / "left").touch()
    os.environ["DVTCLI_SIM"] = "no-such-family"
    os.chdir("/")


@pytest.mark.parametrize(
    "meddle",
    [
        lambda work: (work / "left").touch(),
        lambda work: (work / "scripts").unlink(),
        lambda work: ((work / "tests").unlink(), (work / "tests").mkdir()),
        lambda work: (work.parent / "home" / ".config").mkdir(),
        lambda work: (work.parent / "home").chmod(0o500),
        lambda work: (work.parent / "other").touch(),
        lambda work: (work.parent / "home").rmdir(),
    ],
)
def test_a_place_is_given_again_only_as_it_was_made(tmp_path: Path, meddle: Callable[[Path], object]) -> None:
    places = Places(tmp_path)
    with places.another() as first:
        pass
    with places.another() as second:
        assert second == first
        meddle(second)
    with places.another() as third:
        assert third != first
        test_a_test_has_a_home_and_a_folder_of_its_own()


def test_no_wish_of_whoever_runs_the_tests_gets_in() -> None:
    assert not set(WISHES) & set(environment())
    assert not set(WISHES) & set(os.environ)


@pytest.mark.drawn(0)
def test_a_stray_file_beside_the_checkout_or_the_temporary_folders_changes_nothing(tmp_path: Path) -> None:
    """pytest itself, in a folder below a stray `dvtcli.toml`, with wishes in its environment."""
    (tmp_path / "dvtcli.toml").write_text(STRAY)
    user = tmp_path / "home" / ".config" / "dvtcli"
    user.mkdir(parents=True)
    (user / "config.toml").write_text(STRAY)
    below = tmp_path / "below"
    below.mkdir()
    one = f"{Path(__file__)}::{test_dvtcli_starts_with_nobodys_settings.__name__}"
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", f"--basetemp={below / 'temporary'}", one],
        env=environment() | WISHES | {"HOME": str(tmp_path / "home"), "PYTHONOPTIMIZE": ""},
        cwd=below, capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_dvtcli_starts_with_nobodys_settings(tmp_path: Path) -> None:
    for folder in (None, tmp_path):
        ran = dvtcli("--sim", "gen4", "--json", "read", "1018:1", cwd=folder)
        assert ran.returncode == 0, ran.stderr
    with Bench() as bench:
        assert bench.run("read 1018:1").code == 0
