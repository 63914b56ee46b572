"""Files that a command makes for people: whole or not there, where a link of that name leads. Knows no content."""

from __future__ import annotations

import os
from pathlib import Path
from stat import S_IMODE

from dvtcli.device.change.private_file import put_in_place
from dvtcli.errors import UsageError


def write_whole(path: Path, data: bytes) -> None:
    """Write the file whole or not at all, for others to read, too; UsageError where that cannot be.

    A link stays, and the file that it leads to is written. What is no file, as a pipe, is written as it comes.
    """
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(data)
        else:
            _replace(Path(os.path.realpath(path)), data)
    except OSError as failed:
        raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed


def _replace(target: Path, data: bytes) -> None:
    made = target.parent / f".{os.urandom(8).hex()}.new"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        with os.fdopen(os.open(made, flags, _mode(target)), "wb") as file:
            file.write(data)
        put_in_place(made, target)
    finally:
        made.unlink(missing_ok=True)


def _mode(target: Path) -> int:
    """Who may read the file: who may already; others, too, where it is new, but for the umask."""
    try:
        return S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        return 0o644
