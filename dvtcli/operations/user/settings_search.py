"""Find the settings files in force: a project's, searched upward, and the user's own; and check their owners."""

from __future__ import annotations

import os
import stat
import sys
from typing import NamedTuple

from dvtcli.device.change.private_file import replaceable, stranger, sudo_user
from dvtcli.errors import DvtcliError, InputFileError, SafetyRefusal, UsageError
from dvtcli.files.user_folders import user_folder

#: The variable that names a project's file, then trusted wherever it is.
VARIABLE = "DVTCLI_CONFIG"
NAME = "dvtcli.toml"
#: Marks of a repository's root.
_ROOTS = (".git", ".hg")


class SettingsFile(NamedTuple):
    """A settings file at *path*; *named* by the environment: its owner is not checked."""

    path: str
    named: bool = False


def project_file() -> SettingsFile | None:
    """Find the file of DVTCLI_CONFIG, else the nearest `dvtcli.toml` here or above.

    Searches up to the root of the repository or the user's home, never above a home. Returns None if there is none.
    Raises UsageError if DVTCLI_CONFIG names no file, SafetyRefusal if a folder cannot be read.
    """
    if named := os.environ.get(VARIABLE):
        if not os.path.exists(named):  # noqa: PTH110 - pathlib costs 7 ms of a --help
            raise UsageError(f"{VARIABLE}={named}: no such file", hint=f"unset {VARIABLE}, or let it name a file")
        return SettingsFile(os.path.abspath(named), named=True)  # noqa: PTH100
    for folder in _folders():
        path = os.path.join(folder, NAME)  # noqa: PTH118
        try:
            os.lstat(path)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as failed:
            raise SafetyRefusal(
                f"{folder} cannot be searched for {NAME}: {failed.strerror}",
                place=folder,
                hint=f"{VARIABLE}=FILE names one; {VARIABLE}={os.devnull} is none",
            ) from failed
        return SettingsFile(path)
    return None


def _folders() -> list[str]:
    """Return folders for a project's file, nearest first."""
    try:
        folder = os.path.realpath(os.getcwd())  # noqa: PTH109
    except FileNotFoundError:
        raise SafetyRefusal("this folder was removed: it is unknown which settings apply here", hint="cd") from None
    homes = _homes()
    above = {parent for home in homes for parent in _parents(home)}
    folders: list[str] = []
    for searched_folder in (folder, *_parents(folder)):
        if searched_folder in above and searched_folder != folder:
            break
        folders.append(searched_folder)
        if searched_folder in homes or any(os.path.lexists(os.path.join(searched_folder, root)) for root in _ROOTS):  # noqa: PTH118
            break
    return folders


def _parents(folder: str) -> list[str]:
    found = []
    while (above := os.path.dirname(folder)) != folder:  # noqa: PTH120
        folder = above
        found.append(folder)
    return found


def _homes() -> set[str]:
    """Return the user's home, and that of sudo's caller."""
    homes = {os.path.realpath(os.path.expanduser("~"))}  # noqa: PTH111
    caller = sudo_user()
    if caller is not None and sys.platform != "win32":
        import pwd

        try:
            homes.add(os.path.realpath(pwd.getpwuid(caller).pw_dir))
        except KeyError:
            return homes  # a number without a name has no home either
    return homes


def user_file() -> SettingsFile | None:
    """Return the user's own `config.toml`, None if there is none."""
    path = str(user_folder("config") / "config.toml")
    return SettingsFile(path) if os.path.lexists(path) else None


def content(found: SettingsFile, most_bytes: int) -> bytes:
    """Read the file, up to *most_bytes* plus a byte.

    Raises SafetyRefusal with a remedy if another user may have written it, InputFileError if it cannot be read.
    """
    path = found.path
    try:
        if not found.named:
            _refuse_strangers(path, os.lstat(path), os.path.dirname(path))  # noqa: PTH120
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
        with os.fdopen(descriptor, "rb") as file:
            status = os.fstat(file.fileno())
            if not found.named:
                _refuse_strangers(path, status, os.path.dirname(os.path.realpath(path)))  # noqa: PTH120
            if not stat.S_ISREG(status.st_mode) and not os.path.samefile(path, os.devnull):  # noqa: PTH121
                raise InputFileError(f"{path}: not a file", place=path, hint="remove it, or give it another name")
            return file.read(most_bytes + 1)
    except OSError as failed:
        hint = None if isinstance(failed, PermissionError) else "remove it, or mend it"
        raise InputFileError(f"{path}: cannot be read: {failed.strerror}", place=path, hint=hint) from failed


def _refuse_strangers(path: str, status: os.stat_result, folder: str) -> None:
    """Raises SafetyRefusal if, by *status* or *folder*, another user controls *path*."""
    is_link = stat.S_ISLNK(status.st_mode)
    found = stranger(path, status) if not is_link else _link_of_stranger(path, status)
    found = found or replaceable(folder)
    if found is not None:
        why, cure = found
        trusting = f"; or {VARIABLE}={path} in the environment trusts it as it is" if _is_project(path) else ""
        raise SafetyRefusal(f"{path} is not trusted: {why}", place=path, hint=f"{cure}{trusting}")


def _link_of_stranger(path: str, status: os.stat_result) -> tuple[str, str] | None:
    """Report a link of another user: its owner decides, as a link's mode says nothing."""
    found = stranger(path, os.stat_result((status.st_mode & ~0o022, *status[1:])))
    return found and (found[0].replace("it belongs", "the link belongs"), f"rm {path}")


def _is_project(path: str) -> bool:
    return os.path.basename(path) == NAME  # noqa: PTH119


def why_unusable(path: str) -> DvtcliError | None:
    """Return the error of the settings file *path* at the next start, None if it is usable."""
    try:
        content(SettingsFile(os.path.abspath(path)), 0)  # noqa: PTH100
    except DvtcliError as refused:
        return refused
    return None
