"""Write users' files: whole and readable, or not at all; follows links."""

from __future__ import annotations

import os
from pathlib import Path
from stat import S_IMODE
from typing import TYPE_CHECKING

from dvtcli.device.change.private_file import put_in_place
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DvtcliError, InputFileError, UsageError

if TYPE_CHECKING:
    from dvtcli.files.read_back import ReadBack


def write_whole(path: Path, data: bytes, read_back: ReadBack | None = None) -> None:
    """Write a file whole or not at all, readable for others; raises UsageError if impossible.

    *read_back* reads the new file before it gets its name: after an InputFileError the old file stays. A link stays,
    and its target is written. Pipes and other special files are written directly.
    """
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(data)
        else:
            _replace(path, Path(os.path.realpath(path)), data, read_back)
    except OSError as failed:
        raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed


def _replace(path: Path, target: Path, data: bytes, read_back: ReadBack | None) -> None:
    made = target.parent / f".{os.urandom(8).hex()}.new{path.suffix}"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        with os.fdopen(os.open(made, flags, _mode(target)), "wb") as file:
            file.write(data)
        if read_back is not None:
            _read_back(path, made, read_back)
        put_in_place(made, target)
    finally:
        made.unlink(missing_ok=True)


def _read_back(path: Path, made: Path, read_back: ReadBack) -> None:
    try:
        read_back(made)
    except DvtcliError as failed:
        said = ": ".join(filter(None, (failed.text, failed.why)))
        why = said.replace(str(made), str(path)).replace(made.name, path.name)
        unlike = InputFileError(
            f"{path} is not written: its content cannot be read back",
            place=str(path),
            why=why,
            hint=Hint(Action.CHECK_EDS, why="its source may be at fault: {} checks a device's file"),
        )
        unlike.outcome = "the earlier file of that name stays"
        raise unlike from failed


def _mode(target: Path) -> int:
    """Return the mode of the file: its own, or the umask's for a new file."""
    try:
        return S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        return 0o644
