"""Files that only their owner reads, whole or not there, and on the disk once they are written. Knows no content."""

from __future__ import annotations

import os
import re
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from dvtcli.device.trust import private_folder


def file_name(text: str) -> str:
    """*text* with everything that a file name should not have as `_`."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", text).strip("_") or "bus"


def write_private(path: Path, text: str) -> None:
    """Write a file whole or not at all, readable by its owner only, and on the disk when this returns.

    A link of that name is replaced, never followed. SafetyRefusal where others can write its folder or the one above,
    which is the state folder.
    """
    private_folder(path.parent.parent)
    private_folder(path.parent)
    descriptor, temporary = tempfile.mkstemp(dir=path.parent)  # 0600
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)  # noqa: PTH105 - atomic on every platform
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def set_aside(path: Path, word: str) -> Path:
    """Give *path* a name that nobody looks for, with *word* and the time in it; returns that name."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    aside = path.with_name(f"{path.name}.{word}-{stamp}")
    os.replace(path, aside)  # noqa: PTH105 - atomic on every platform
    sync_folder(path.parent)
    return aside


def sync_folder(folder: Path) -> None:
    """Make a new or removed name durable; folders cannot be opened for that on Windows, and there may be none."""
    if os.name == "nt" or not folder.is_dir():
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
