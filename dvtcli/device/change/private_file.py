"""Files that only their owner reads, whole or not there, and on the disk once they are written. Knows no content."""

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
    """*text* with everything that a file name should not have as `_`."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", text).strip("_") or "bus"


def write_private(path: Path, text: str, *, newline: str | None = None) -> None:
    """Write a file whole or not at all, readable by its owner only, and on the disk when this returns.

    A link of that name is replaced, never followed. *newline* is as `open` takes it. SafetyRefusal where others can
    write its folder or the one above, which is the state folder.
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
    """Remove what processes that have ended left of the files of *folder* named like *pattern*: nobody writes them now.

    What cannot be removed stays, and harms nobody: no name of it is looked for.
    """
    for path in folder.glob(f"{pattern}.*{_UNFINISHED}"):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def unfinished(folder: Path) -> list[Path]:
    """The files of *folder* that are being written now, or were when their process ended; also of earlier versions."""
    return sorted([*folder.glob(f"*{_UNFINISHED}"), *folder.glob("tmp????????")])


def set_aside(path: Path, word: str) -> Path:
    """Give *path* a name that nobody looks for, with *word* and the time in it; returns that name."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    aside = path.with_name(f"{path.name}.{word}-{stamp}")
    put_in_place(path, aside)
    sync_folder(path.parent)
    return aside


def put_in_place(source: str | Path, target: Path) -> None:
    """Give *source* the name *target*, at one stroke on every platform; OSError where that cannot be."""
    _when_free(lambda: os.replace(source, target))  # noqa: PTH105 - as it is documented: atomic


def remove(path: Path) -> None:
    """Take *path* away where it is there; OSError where that cannot be."""
    _when_free(lambda: path.unlink(missing_ok=True))


def _when_free(act: Callable[[], object]) -> None:
    """Do *act*. On Windows nothing that is open can be moved or removed, and scanners open what was just written."""
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
    """Wait until what was written to *descriptor* is on the disk; on macOS fsync leaves it in the drive's memory."""
    if sys.platform == "darwin":
        import fcntl

        with suppress(OSError):  # a network's file system may not have it: then fsync is what there is
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
            return
    os.fsync(descriptor)


def sync_folder(folder: Path) -> None:
    """Make a new or removed name durable; folders cannot be opened for that on Windows, and there may be none."""
    if os.name == "nt" or not folder.is_dir():
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
