"""Decide which files to trust, and keep files and folders private to the user.

Trusted are files owned by the user (or the caller of sudo) and writable only by them and their own group. Windows has
no such owners and modes: every file counts as trusted, and folders inherit their rights.
"""

from __future__ import annotations

import os
import stat
import sys

from dvtcli.errors import SafetyRefusal

_EVERYBODY, _GROUP = 0o002, 0o020
#: never through a symbolic link, never waiting for the other end of a pipe; 0 where a system has no such flag
_CAREFUL = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NONBLOCK", 0)
_CAREFUL |= getattr(os, "O_BINARY", 0)

#: what takes another folder for what every dvtcli of a user looks at, as locks; empty if only the system decides
OTHER_STATE = "XDG_STATE_HOME=DIR takes another state folder" if sys.platform == "linux" else ""
_CURE = "let its owner give you the right to write it" + (f"; {OTHER_STATE}" if OTHER_STATE else "")


def stranger(path: str, status: os.stat_result) -> tuple[str, str] | None:
    """The other user in control of *path*, by its *status*, and a shell command to fix this; None if there is none."""
    if sys.platform == "win32":
        return None
    from shlex import quote

    if status.st_uid not in _own_users():
        return f"it belongs to {_user(status.st_uid)}", f'sudo chown "$USER" {quote(path)}'
    if status.st_mode & _EVERYBODY:
        return "everybody can write it", f"chmod o-w {quote(path)}"
    if status.st_mode & _GROUP and status.st_gid not in _own_groups():
        return f"group {status.st_gid} can write it, which is not the user's own", f"chmod g-w {quote(path)}"
    return None


def replaceable(folder: str) -> tuple[str, str] | None:
    """Why everybody can replace a file in *folder*, and the fix; None if nobody can."""
    if sys.platform == "win32":
        return None
    from shlex import quote

    mode = os.stat(folder).st_mode  # noqa: PTH116 - pathlib costs 7 ms of a --help
    if mode & _EVERYBODY and not mode & stat.S_ISVTX:
        return f"everybody can write its folder {folder}", f"chmod o-w {quote(folder)}"
    return None


def is_own_user(number: int | None) -> bool:
    """True if the user-ID *number* (None: unknown) is the user's, or that of the caller of sudo."""
    return number is not None and number in _own_users()


def sudo_user() -> int | None:
    """The user-ID of the caller of sudo; valid for root only, as other users could set it freely."""
    if sys.platform == "win32" or os.geteuid() != 0:
        return None
    said = os.environ.get("SUDO_UID", "")
    return int(said) if said.isdecimal() and said.isascii() and len(said) <= 10 else None


def private_folder(folder: str | os.PathLike[str], *, is_shared: bool = False) -> None:
    """Make *folder* and its missing parents private to the user (0700), regardless of the umask.

    *is_shared* as for `check_folder`. Raises SafetyRefusal with the fix if others can write to it, or its place is
    taken by another file; OSError if it cannot be made.
    """
    path = os.path.abspath(folder)  # noqa: PTH100
    missing = []
    while not os.path.isdir(path):  # noqa: PTH112
        if os.path.lexists(path):
            raise _no_folder(path)
        missing.append(path)
        path = os.path.dirname(path)  # noqa: PTH120
    for new in reversed(missing):
        _make(new)
    check_folder(folder, is_shared=is_shared)


def unusable(folder: str | os.PathLike[str]) -> SafetyRefusal | None:
    """Why *folder*, existing or not, cannot be used, with the fix; None if usable. Creates nothing."""
    path = os.path.abspath(folder)  # noqa: PTH100
    while not os.path.isdir(path):  # noqa: PTH112
        if os.path.lexists(path):
            return _no_folder(path)
        path = os.path.dirname(path)  # noqa: PTH120
    if os.access(path, os.W_OK | os.X_OK):
        return None
    return SafetyRefusal(f"{path} is not used: it cannot be written", place=path, hint=_CURE)


def unreadable(folder: str | os.PathLike[str]) -> SafetyRefusal | None:
    """Why the content of *folder* cannot be listed, with the fix; None if listable or missing."""
    path = wanted = os.path.abspath(folder)  # noqa: PTH100
    while not os.path.isdir(path):  # noqa: PTH112
        if os.path.lexists(path):
            return _no_folder(path)
        path = os.path.dirname(path)  # noqa: PTH120
    if os.access(path, os.R_OK | os.X_OK if path == wanted else os.X_OK):
        return None
    hint = "let its owner give you the right to read it" + (f"; {OTHER_STATE}" if OTHER_STATE else "")
    return SafetyRefusal(f"{path} is not used: it cannot be read", place=path, hint=hint)


def _no_folder(path: str) -> SafetyRefusal:
    from shlex import quote

    what = "a link that leads nowhere" if os.path.islink(path) else "a file, and no folder"  # noqa: PTH114
    hint = f"mv {quote(path)} {quote(path + '.old')}"
    return SafetyRefusal(f"{path} is not used: it is {what}", place=path, hint=hint)


def _make(folder: str) -> None:
    try:
        os.mkdir(folder, 0o700)  # noqa: PTH102
    except FileExistsError:  # another dvtcli was faster: what it made is looked at by `check_folder`
        if not os.path.isdir(folder):  # noqa: PTH112
            raise
    else:
        os.chmod(folder, 0o700)  # noqa: PTH101 - an umask may have taken from the owner, too


def check_folder(folder: str | os.PathLike[str], *, is_shared: bool = False) -> None:
    """Raise SafetyRefusal with the fix if another user can write to *folder*; a missing folder is fine.

    *is_shared*: every dvtcli process of the user uses the folder, independent of its journals.
    """
    path = os.fspath(folder)
    for look in (os.lstat, os.stat):  # a link that somebody else made may lead elsewhere tomorrow
        try:
            status = look(path)
        except (FileNotFoundError, NotADirectoryError):
            return
        found = None if stat.S_ISLNK(status.st_mode) and _is_ours(status) else stranger(path, status)
        if found is not None:
            from dvtcli.domain.hint import Action, Hint

            moved = Hint(Action.GIVE_JOURNAL, why="or another folder: {}")
            other = found[1] + (f"; {OTHER_STATE}" if OTHER_STATE else "") if is_shared else found[1] + moved
            raise SafetyRefusal(f"{path} is not used: {found[0]}", place=path, hint=other)


def open_private(path: str | os.PathLike[str], flags: int) -> int:
    """Open the user's own file *path* with *flags* of `os.open`; a new file gets 0600 regardless of the umask.

    Returns a descriptor. Raises SafetyRefusal for a symbolic link, a special file, another user's file or a hard link:
    data would be written elsewhere. Raises OSError as `os.open`.
    """
    name = os.fspath(path)
    if os.path.islink(name):  # noqa: PTH114 - O_NOFOLLOW refuses as well, in words that nobody understands
        raise _no_file_of_ours(name, "it is a symbolic link")
    descriptor = os.open(name, flags | _CAREFUL, 0o600)
    try:
        status = os.fstat(descriptor)
        why = _not_ours(status)
        if why is not None:
            raise _no_file_of_ours(name, why)
        if sys.platform != "win32" and stat.S_IMODE(status.st_mode) != 0o600:
            os.fchmod(descriptor, 0o600)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _not_ours(status: os.stat_result) -> str | None:
    if not stat.S_ISREG(status.st_mode):
        return "it is no regular file"
    if not _is_ours(status):
        return f"it belongs to {_user(status.st_uid)}"
    return "it is another file's second name (a hard link)" if status.st_nlink > 1 else None


def _no_file_of_ours(path: str, why: str) -> SafetyRefusal:
    return SafetyRefusal(f"{path} is not used: {why}", place=path, hint="look at it, then remove it")


def _is_ours(status: os.stat_result) -> bool:
    return sys.platform == "win32" or status.st_uid in _own_users()


def _own_users() -> set[int | None]:
    if sys.platform == "win32":
        return set()
    return {os.geteuid(), sudo_user()}


def _own_groups() -> set[int]:
    if sys.platform == "win32":
        return set()
    said = os.environ.get("SUDO_GID", "") if sudo_user() is not None else ""
    sudo_group = {int(said)} if said.isdecimal() and said.isascii() and len(said) <= 10 else set()
    return {os.getgid(), os.getegid()} | sudo_group


def _user(number: int) -> str:
    """The user's name, if known."""
    if sys.platform == "win32":
        return str(number)
    import pwd

    try:
        return f"{pwd.getpwuid(number).pw_name} (user {number})"
    except KeyError:
        return f"user {number}"
