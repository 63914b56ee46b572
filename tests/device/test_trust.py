"""Whose files are believed: by owner, mode and group, as the one who called sudo has them too."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.change.private_file import (
    check_folder,
    open_private,
    private_folder,
    replaceable,
    stranger,
    sudo_user,
)
from dvtcli.errors import SafetyRefusal

pytestmark = pytest.mark.skipif(os.name != "posix", reason="Windows has no owners and modes of this kind")
AS_ROOT = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root is called by sudo")
NOBODY = 54321


def status(mode: int = 0o644, uid: int | None = None, gid: int | None = None) -> os.stat_result:
    """What the system says of a file of ours, but for *uid* and *gid*."""
    owner, group = os.geteuid() if uid is None else uid, os.getegid() if gid is None else gid
    return os.stat_result((stat.S_IFREG | mode, 1, 1, 1, owner, group, 0, 0, 0, 0))


def why(held: os.stat_result) -> str:
    found = stranger("a b", held)
    return "" if found is None else found[0]


def test_what_only_its_owner_and_their_group_can_write_is_ours() -> None:
    assert why(status(0o644)) == ""
    assert why(status(0o664)) == ""
    assert why(status(0o755, gid=NOBODY)) == ""


def test_who_else_can_write_it_and_what_cures_that() -> None:
    assert stranger("a b", status(uid=NOBODY)) == (f"it belongs to user {NOBODY}", "sudo chown \"$USER\" 'a b'")
    assert stranger("a b", status(0o646)) == ("everybody can write it", "chmod o-w 'a b'")
    text = f"group {NOBODY} can write it, which is not the user's own"
    assert stranger("a b", status(0o664, gid=NOBODY)) == (text, "chmod g-w 'a b'")


@AS_ROOT
def test_a_known_user_is_named() -> None:
    import pwd

    other = next(one for one in pwd.getpwall() if one.pw_uid != os.geteuid())
    assert why(status(uid=other.pw_uid)) == f"it belongs to {other.pw_name} (user {other.pw_uid})"


def test_nobody_but_root_was_called_by_sudo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else whoever sets a variable would have their files believed."""
    monkeypatch.setenv("SUDO_UID", str(NOBODY))
    was = os.geteuid()
    if was == 0:
        os.seteuid(NOBODY)
    try:
        assert sudo_user() is None
    finally:
        os.seteuid(was)


@AS_ROOT
@pytest.mark.parametrize(
    ("said", "user"),
    [("54321", 54321), ("0", 0), ("4294967294", 4294967294), ("42949672940", None), ("", None), ("-1", None),
     ("5x", None), ("٥", None)],
)  # fmt: skip
def test_the_one_who_called_sudo(monkeypatch: pytest.MonkeyPatch, said: str, user: int | None) -> None:
    monkeypatch.setenv("SUDO_UID", said)
    assert sudo_user() == user
    if user is not None:
        assert why(status(uid=user)) == ""
    assert why(status(uid=NOBODY + 1)) != ""


@AS_ROOT
@pytest.mark.parametrize(
    ("user", "group", "ours"),
    [("54321", "54321", True), ("54321", "54322", False), ("", "54321", False), ("54321", "00000054321", False),
     ("54321", "0000054321", True), ("54321", "x", False), ("54321", "٥٤٣٢١", False)],
)  # fmt: skip
def test_the_group_of_the_one_who_called_sudo(
    monkeypatch: pytest.MonkeyPatch, user: str, group: str, ours: bool
) -> None:
    monkeypatch.setenv("SUDO_UID", user)
    monkeypatch.setenv("SUDO_GID", group)
    assert (why(status(0o664, gid=NOBODY)) == "") == ours
    assert why(status(0o664)) == "", "our own group stays ours"


@pytest.mark.parametrize(("mode", "can"), [(0o755, False), (0o777, True), (0o1777, False), (0o775, False)])
def test_whether_everybody_can_replace_a_file(tmp_path: Path, mode: int, can: bool) -> None:
    tmp_path.chmod(mode)
    told = (f"its folder {tmp_path} is writable by everybody", f"chmod o-w {tmp_path}") if can else None
    assert replaceable(str(tmp_path)) == told
    tmp_path.chmod(0o700)


def test_a_folder_is_made_with_what_is_missing_above_it_for_its_owner_alone(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        private_folder(tmp_path / "one" / "two")
        os.umask(0o777)
        private_folder(tmp_path / "one" / "three")
    finally:
        os.umask(before)
    made = [tmp_path / "one", tmp_path / "one" / "two", tmp_path / "one" / "three"]
    assert [stat.S_IMODE(path.stat().st_mode) for path in made] == [0o700] * 3


def test_a_folder_that_others_can_write_is_not_used(tmp_path: Path) -> None:
    open_to_all = tmp_path / "open"
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    link = tmp_path / "link"
    link.symlink_to(open_to_all)
    for path in (open_to_all, link):
        with pytest.raises(SafetyRefusal) as caught:
            private_folder(path)
        assert caught.value.text == f"{path} is not used: everybody can write it"
        assert typed(caught.value.hint) == f"chmod o-w {path}; or another folder: --journal DIR"
    check_folder(tmp_path / "none")
    (tmp_path / "file").write_text("")
    check_folder(tmp_path / "file" / "below")
    open_to_all.chmod(0o700)
    check_folder(link)


def test_a_file_is_opened_for_its_owner_alone_and_never_elsewhere(tmp_path: Path) -> None:
    path = tmp_path / "file"
    before = os.umask(0)
    try:
        os.close(open_private(path, os.O_RDWR | os.O_CREAT))
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    path.chmod(0o666)
    descriptor = open_private(path, os.O_RDWR)
    assert not os.get_inheritable(descriptor)
    os.close(descriptor)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    (tmp_path / "link").symlink_to(path)
    (tmp_path / "second").hardlink_to(path)
    os.mkfifo(tmp_path / "pipe")
    for name, reason in (
        ("link", "it is a symbolic link"),
        ("second", "it is another file's second name (a hard link)"),
        ("pipe", "it is not a regular file"),
    ):
        with pytest.raises(SafetyRefusal) as caught:
            open_private(tmp_path / name, os.O_RDONLY)
        assert caught.value.text == f"{tmp_path / name} is not used: {reason}"
        assert typed(caught.value.hint) == "check it, then remove it"


@AS_ROOT
def test_a_file_of_somebody_else_is_not_opened(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    os.chown(path, NOBODY, NOBODY)
    with pytest.raises(SafetyRefusal, match=f"it belongs to user {NOBODY}"):
        open_private(path, os.O_RDONLY)
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "link").symlink_to(folder)
    os.chown(tmp_path / "link", NOBODY, NOBODY, follow_symlinks=False)
    with pytest.raises(SafetyRefusal, match=f"it belongs to user {NOBODY}"):
        check_folder(tmp_path / "link")


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="no /proc: open files cannot be counted")
def test_what_is_refused_is_closed_again(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    (tmp_path / "second").hardlink_to(path)
    before = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(SafetyRefusal):
        open_private(path, os.O_RDONLY)
    assert len(list(Path("/proc/self/fd").iterdir())) == before
