"""Settings files of others choose no bus and are never skipped silently; what a project may not say is never taken."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.commands.program.settings_bench import STRANGER, WHY_NOT, Place, place
from tests.process import documents

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="Windows has no owners and modes of this kind"),
    pytest.mark.drawn(10, "settings trust"),
]
AS_ROOT = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
GEN4 = 30


@pytest.fixture(scope="module")
def served_place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with place(tmp_path_factory.mktemp("trust")) as found:
        yield found


@pytest.fixture
def here(served_place: Place) -> Iterator[Place]:
    """The place without any settings file, before and after."""
    yield served_place
    for path in [path for path in served_place.folder.rglob("*") if path.name in ("dvtcli.toml", "config.toml")]:
        path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
    (served_place.project / ".git").mkdir(exist_ok=True)
    (served_place.project / ".hg").rmdir() if (served_place.project / ".hg").exists() else None
    served_place.project.chmod(0o755)
    served_place.give(os.geteuid())


def write(path: Path, text: str, mode: int = 0o644) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(mode)
    return path


@pytest.mark.parametrize("mark", [".git", ".hg", "a .git of a worktree"])
def test_the_search_ends_at_the_root_of_the_repository(here: Place, mark: str) -> None:
    (here.project / ".git").rmdir()
    if mark == ".hg":
        (here.project / ".hg").mkdir()
    elif mark == ".git":
        (here.project / ".git").mkdir()
    else:
        (here.project / ".git").write_text("gitdir: elsewhere\n")
    outside = write(here.home / "dvtcli.toml", here.bus)
    here.refused(code=5, error="bus")
    outside.rename(here.project / "dvtcli.toml")
    assert here.read() == GEN4
    if mark.startswith("a "):
        (here.project / ".git").unlink()


def test_the_search_ends_at_the_home_and_never_looks_above_one(here: Place) -> None:
    (here.project / ".git").rmdir()
    above = write(here.folder / "dvtcli.toml", here.bus)
    here.refused(code=5, error="bus")
    elsewhere = here.folder / "elsewhere" / "deeper"
    elsewhere.mkdir(parents=True)
    here.refused(code=5, error="bus", cwd=elsewhere)
    assert here.read(cwd=here.folder) == GEN4, "the folder itself is no search"
    above.rename(here.home / "dvtcli.toml")
    assert here.read() == GEN4


@pytest.mark.parametrize("mode", [0o646, 0o666, 0o602])
def test_a_file_that_everybody_can_write_is_refused_with_the_cure(here: Place, mode: int) -> None:
    path = write(here.project / "dvtcli.toml", here.bus, mode)
    write(here.home / ".config" / "dvtcli" / "config.toml", here.bus)
    error = here.refused()
    assert error["text"] == f"{path} is not trusted: everybody can write it"
    assert error["hint"].startswith(f"chmod o-w {path}; or DVTCLI_CONFIG={path} ")
    here.refused("--sim", "gen4", "read", "1018:1")  # also where the bus was chosen by a stronger word
    path.chmod(mode & ~0o002)
    assert here.read() == GEN4
    path.chmod(mode)
    assert here.read(DVTCLI_CONFIG=str(path)) == GEN4


def test_a_folder_in_which_everybody_can_put_another_is_refused(here: Place) -> None:
    write(here.project / "dvtcli.toml", here.bus)
    here.project.chmod(0o777)
    error = here.refused()
    assert f"its folder {here.project} is writable by everybody" in error["text"]
    assert f"chmod o-w {here.project}" in error["hint"]
    here.project.chmod(0o1777)  # as /tmp: nobody can put another in the place of ours
    assert here.read() == GEN4


@AS_ROOT
def test_a_file_of_somebody_else_is_refused_whoever_it_is(here: Place) -> None:
    path = write(here.project / "dvtcli.toml", here.bus)
    os.chown(path, STRANGER, STRANGER)
    assert here.refused()["text"] == f"{path} is not trusted: it belongs to user {STRANGER}"
    assert here.read(DVTCLI_CONFIG=str(path)) == GEN4

    here.give(STRANGER)
    assert here.read(user=STRANGER) == GEN4
    os.chown(path, 0, 0)
    assert here.refused(user=STRANGER)["text"] == f"{path} is not trusted: it belongs to root (user 0)"
    assert here.read(user=STRANGER, DVTCLI_CONFIG=str(path)) == GEN4
    os.chown(path, STRANGER + 1, STRANGER)
    here.refused(user=STRANGER)


@AS_ROOT
def test_a_file_of_the_one_who_called_sudo_is_fine_and_only_root_may_say_so(here: Place) -> None:
    path = write(here.project / "dvtcli.toml", here.bus, 0o664)
    here.give(STRANGER)
    assert here.read(SUDO_UID=str(STRANGER), SUDO_GID=str(STRANGER)) == GEN4
    here.refused(SUDO_UID=str(STRANGER + 1))
    here.refused(SUDO_UID="-1")
    os.chown(path, 0, 0)
    here.refused(user=STRANGER, SUDO_UID="0", SUDO_GID="0")


@AS_ROOT
def test_what_the_users_own_group_can_write_is_fine(here: Place) -> None:
    path = write(here.project / "dvtcli.toml", here.bus, 0o664)
    here.give(STRANGER)
    assert here.read(user=STRANGER) == GEN4
    os.chown(path, STRANGER, STRANGER + 1)
    error = here.refused(user=STRANGER)
    assert f"group {STRANGER + 1} can write it" in error["text"]
    assert f"chmod g-w {path}" in error["hint"]


@AS_ROOT
def test_a_link_of_somebody_else_is_refused(here: Place) -> None:
    write(here.home / "dvtcli.toml", here.bus)
    ours = write(here.project / "ours.toml", here.bus)
    path = here.below / "dvtcli.toml"
    path.symlink_to(ours)
    here.give(STRANGER)
    assert here.read(user=STRANGER) == GEN4
    os.chown(path, 0, 0, follow_symlinks=False)
    assert "the link belongs to root" in here.refused(user=STRANGER)["text"]
    ours.unlink()


@pytest.mark.parametrize("kind", ["folder", "pipe", "link to nothing"])
def test_what_is_called_so_and_is_no_file_is_no_reason_to_look_further(here: Place, kind: str) -> None:
    write(here.project / "dvtcli.toml", here.bus)
    path = here.below / "dvtcli.toml"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(here.below / "gone")
    assert str(path) in here.refused(code=4, error="input_file")["text"]


def test_a_named_file_is_used_and_no_other_is_looked_for(here: Place) -> None:
    write(here.project / "dvtcli.toml", "broken =", 0o666)
    named = write(here.folder / "named.toml", here.bus, 0o666)
    assert here.read(DVTCLI_CONFIG=str(named)) == GEN4
    here.refused(code=5, error="bus", DVTCLI_CONFIG=os.devnull)
    assert "no such file" in here.refused(code=2, error="usage", DVTCLI_CONFIG=str(here.folder / "none"))["text"]
    named.unlink()


@pytest.mark.parametrize("text", ["broken =", None], ids=["wrong", "not trusted"])
def test_commands_that_need_no_bus_go_on(here: Place, text: str | None) -> None:
    write(here.project / "dvtcli.toml", text or here.bus, 0o644 if text else 0o666)
    before = here.relay.visitors
    for words in ("--help", "--version", "help", "help map", "map --help", "tour", "eds --help", "profiles"):
        ran = here.run(*words.split())
        assert (ran.returncode, bool(ran.stdout)) == (0, True), (words, ran.stderr)
    ran = here.run("doctor", "--json")
    document, *_ = documents(ran.stdout)
    (said,) = [check for check in document["checks"] if check["check"] == "settings"]
    assert (ran.returncode, said["verdict"]) == ((4 if text else 6), "fail")
    assert str(here.project / "dvtcli.toml") in said["text"]
    for stdin in ("read 1018:1\n", "help\nread 1018:1\n"):
        assert here.run(stdin=stdin).returncode == (4 if text else 6)
    assert here.relay.visitors == before, "something was sent"


@pytest.mark.parametrize("line", ["yes = true", "force = true", "no-shell = true", "no_shell = true", 'passcode = "1"'])
def test_a_projects_file_never_decides_for_the_user(here: Place, line: str) -> None:
    path = write(here.project / "dvtcli.toml", f"{line}\n{here.bus}")
    ran = here.run("-n", "1", "--json", stdin="read 1018:1\nrestore\n")
    assert ran.returncode == 6, "nobody said yes to restore"
    key = line.split(" ", maxsplit=1)[0].replace("_", "-")
    own = here.home / ".config" / "dvtcli" / "config.toml"
    said = f"warning: {path}: {key}: never taken from a project's file; it may stand in {own}\n"
    assert ran.stderr.count(said) == 1, ran.stderr


def test_the_users_own_file_may_say_yes_and_force(here: Place) -> None:
    own = write(here.home / ".config" / "dvtcli" / "config.toml", f"yes = true\nforce = true\n{here.bus}")
    assert here.run("-n", "1", "restore").returncode == 0
    own.chmod(0o666)
    assert here.refused()["text"] == f"{own} is not trusted: everybody can write it"
    own.chmod(0o644)
    assert tomllib.loads(own.read_text())["yes"] is True
