"""Files readable by their owner only, written atomically and synced to disk."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.trust import private_folder

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
