"""Files as Windows has them: what is open is neither replaced nor removed, some names are none, text has a code page.

For everybody in the process, since most files are opened by the standard library for others.
"""

from __future__ import annotations

import builtins
import fcntl
import io
import os
import re
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

#: what text is written in where nobody says something else, in western Europe
CODE_PAGE = "cp1252"
_NO_NAME = re.compile(r'[<>:"|?*\x00-\x1f]|[ .]$|^(con|prn|aux|nul|com[1-9]|lpt[1-9])(\.|$)', re.IGNORECASE)
_BUSY = "The process cannot access the file because it is being used by another process"
#: how often a scanner still has what was just written: each replacement fails as many times first
BUSY_FIRST = "TESTS_BUSY_FIRST"


def strict_files() -> None:  # noqa: C901 - one rule after the other
    """Give `os`, `io` and `open` those rules."""
    usual = {name: getattr(os, name) for name in ("replace", "rename", "unlink", "remove", "mkdir", "open", "fsync")}
    scanned: dict[str, int] = {}

    def replace(source: Any, target: Any, **how: Any) -> None:
        _named(target)
        _free(source)
        _free(target)
        _scanned(os.fspath(target), scanned)
        usual["replace"](source, target, **how)

    def rename(source: Any, target: Any, **how: Any) -> None:
        if os.path.lexists(target):
            raise FileExistsError(17, "Cannot create a file when that file already exists", source, 183, target)
        replace(source, target, **how)

    def removing(remove: Callable[..., None]) -> Callable[..., None]:
        def unlink(path: Any, **how: Any) -> None:
            if "dir_fd" not in how or how["dir_fd"] is None:
                _free(path)
            remove(path, **how)

        return unlink

    def mkdir(path: Any, *rest: Any, **how: Any) -> None:
        _named(path)
        usual["mkdir"](path, *rest, **how)

    def open_descriptor(path: Any, *rest: Any, **how: Any) -> int:
        _named(path)
        return usual["open"](path, *rest, **how)  # type: ignore[no-any-return]

    def fsync(file: Any) -> None:
        descriptor = file if isinstance(file, int) else file.fileno()
        if fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(9, "Bad file descriptor")
        usual["fsync"](descriptor)

    runners: dict[str, Any] = {
        "replace": replace,
        "rename": rename,
        "mkdir": mkdir,
        "open": open_descriptor,
        "fsync": fsync,
    }
    runners |= {name: removing(usual[name]) for name in ("unlink", "remove")}
    for name, way in runners.items():
        setattr(os, name, way)
    builtins.open = io.open = _opening(io.open)


def _opening(usual: Callable[..., Any]) -> Callable[..., Any]:
    def opened(
        file: Any, mode: str = "r", buffering: int = -1, encoding: str | None = None, errors: str | None = None,
        newline: str | None = None, closefd: bool = True, opener: Any = None,
    ) -> Any:  # fmt: skip
        if not isinstance(file, int):
            _named(file)
        if "b" not in mode:
            encoding = CODE_PAGE if encoding in (None, "locale") else encoding
            newline = "\r\n" if newline is None and mode[0] in "wax" else newline
        return usual(file, mode, buffering, encoding, errors, newline, closefd, opener)

    return opened


def _named(path: Any) -> None:
    """OSError for what is no file's name on Windows; names of the system itself, as /proc has them, are let through."""
    for part in os.fsdecode(path).split("/"):
        if part not in (".", "..") and _NO_NAME.search(part) and os.fsdecode(path) != os.devnull:
            raise OSError(22, "Invalid argument", path)


def _free(path: Any) -> None:
    """PermissionError where anybody has the file open: a lease to write is had only where nobody has."""
    with suppress(FileNotFoundError, IsADirectoryError, NotADirectoryError):
        if not Path(path).is_file():
            return
        descriptor = _OPEN(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            fcntl.fcntl(descriptor, 10, signal.SIGURG)  # F_SETSIG: who opens it meanwhile is told by nothing
            fcntl.fcntl(descriptor, fcntl.F_SETLEASE, fcntl.F_WRLCK)
            fcntl.fcntl(descriptor, fcntl.F_SETLEASE, fcntl.F_UNLCK)
        except BlockingIOError as busy:
            raise PermissionError(13, _BUSY, path) from busy
        finally:
            os.close(descriptor)


_OPEN = os.open


def _scanned(target: str, scanned: dict[str, int]) -> None:
    scanned[target] = scanned.get(target, 0) + 1
    if scanned[target] <= int(os.environ.get(BUSY_FIRST, "0")):
        raise PermissionError(13, "Access is denied", target)
