"""Files readable by their owner only, written atomically and synced to disk."""

from __future__ import annotations

import os
import re
import stat
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.errors import SafetyRefusal

#: how long another program may have a file open that is to be replaced or removed, on Windows (s)
BUSY_S = 2.0
_BUSY_RETRY_S = 0.02
#: what the name of a file ends with that is being written, or was when its process ended
_UNFINISHED = ".tmp"


def file_name(text: str) -> str:
    """*text* with characters unsuitable for a file name replaced by `_`."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", text).strip("_") or "bus"


def write_private(path: Path, text: str, *, newline: str | None = None) -> None:
    """Write a file atomically, readable by its owner only and synced to disk on return.

    A symbolic link at *path* is replaced, never followed. *newline* is as for `open`. Raises SafetyRefusal if other
    users can write to the folder or its parent, the state folder.
    """
    import tempfile  # brings archives and random numbers, which a command that only looks does not need

    private_folder(path.parent.parent)
    private_folder(path.parent)
    descriptor, temporary = tempfile.mkstemp(_UNFINISHED, f"{path.name}.", path.parent)  # 0600
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8", newline=newline) as file:
            file.write(text)
            file.flush()
            to_disk(file.fileno())
        put_in_place(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def remove_unfinished(folder: Path, pattern: str) -> None:
    """Remove half-written files matching *pattern* in *folder*, left by processes that have ended.

    A file that cannot be removed stays and is harmless: nobody reads its name.
    """
    for path in folder.glob(f"{pattern}.*{_UNFINISHED}"):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def unfinished(folder: Path) -> list[Path]:
    """The files of *folder* in the course of being written, or left half-written; also of earlier versions."""
    return sorted([*folder.glob(f"*{_UNFINISHED}"), *folder.glob("tmp????????")])


def set_aside(path: Path, word: str) -> Path:
    """Rename *path* with *word* and the time, so that nobody finds it, and return the new path."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    aside = path.with_name(f"{path.name}.{word}-{stamp}")
    put_in_place(path, aside)
    sync_folder(path.parent)
    return aside


def put_in_place(source: str | Path, target: Path) -> None:
    """Rename *source* to *target* atomically on every platform. Raises OSError on failure."""
    _when_free(lambda: os.replace(source, target))  # noqa: PTH105 - as it is documented: atomic


def remove(path: Path) -> None:
    """Remove *path* if present. Raises OSError on failure."""
    _when_free(lambda: path.unlink(missing_ok=True))


def _when_free(act: Callable[[], object]) -> None:
    """Do *act*, with retries on Windows: an open file cannot be moved, and virus scanners open new files."""
    deadline_s = time.monotonic() + BUSY_S
    while True:
        try:
            act()
        except PermissionError:
            if sys.platform != "win32" or time.monotonic() >= deadline_s:
                raise
            time.sleep(_BUSY_RETRY_S)
        else:
            return


def to_disk(descriptor: int) -> None:
    """Sync *descriptor* to disk; on macOS fsync alone leaves data in the drive's cache."""
    if sys.platform == "darwin":
        import fcntl

        with suppress(OSError):  # a network file system may lack this: fsync is the fallback
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
            return
    os.fsync(descriptor)


def sync_folder(folder: Path) -> None:
    """Make a new or removed file name durable; no effect on Windows or without the folder."""
    if os.name == "nt" or not folder.is_dir():
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


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
        return f"its folder {folder} is writable by everybody", f"chmod o-w {quote(folder)}"
    return None


def is_own_user(number: int | None) -> bool:
    """True if the user-ID *number* (None: unknown) is the user's, or that of the caller of sudo."""
    return number is not None and number in _own_users()


def sudo_user() -> int | None:
    """The user-ID of the caller of sudo; valid for root only, as other users could set it freely."""
    if sys.platform == "win32" or os.geteuid() != 0:
        return None
    number = os.environ.get("SUDO_UID", "")
    return int(number) if number.isdecimal() and number.isascii() and len(number) <= 10 else None


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

    what = "a link that leads nowhere" if os.path.islink(path) else "a file, not a folder"  # noqa: PTH114
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
        return "it is not a regular file"
    if not _is_ours(status):
        return f"it belongs to {_user(status.st_uid)}"
    return "it is another file's second name (a hard link)" if status.st_nlink > 1 else None


def _no_file_of_ours(path: str, why: str) -> SafetyRefusal:
    return SafetyRefusal(f"{path} is not used: {why}", place=path, hint="check it, then remove it")


def _is_ours(status: os.stat_result) -> bool:
    return sys.platform == "win32" or status.st_uid in _own_users()


def _own_users() -> set[int | None]:
    if sys.platform == "win32":
        return set()
    return {os.geteuid(), sudo_user()}


def _own_groups() -> set[int]:
    if sys.platform == "win32":
        return set()
    number = os.environ.get("SUDO_GID", "") if sudo_user() is not None else ""
    sudo_group = {int(number)} if number.isdecimal() and number.isascii() and len(number) <= 10 else set()
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
