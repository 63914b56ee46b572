"""Locate the user's own files (settings, device data, state), and detect whether a file has changed.

Creates no folder, and opens no file. platformdirs decides; in the plain case, Linux with absolute paths, importing it
is avoided, because the import costs each command as much as all imports of `--help`.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from tempfile import TemporaryDirectory

Kind = Literal["config", "data", "state"]
#: On Linux the variable of each kind, and its default folder below the user's home (XDG).
_XDG: dict[Kind, tuple[str, str]] = {
    "config": ("XDG_CONFIG_HOME", ".config"),
    "data": ("XDG_DATA_HOME", ".local/share"),
    "state": ("XDG_STATE_HOME", ".local/state"),
}


def user_folder(kind: Kind) -> Path:
    """Return the folder of the user's files of that *kind*, existing or not."""
    plain = _plain(kind)
    if plain is not None:
        return Path(plain, "dvtcli")
    import platformdirs

    return Path(getattr(platformdirs, f"user_{kind}_dir")("dvtcli"))


def file_state(path: Path) -> tuple[int, ...]:
    """Return a key that changes if the file at *path* is written or replaced, even with equal time and size."""
    now = path.stat()
    return now.st_ino, now.st_ctime_ns, now.st_mtime_ns, now.st_size


def _plain(kind: Kind) -> str | None:
    """Return the parent folder in the plain case on Linux, by XDG variable and HOME; None otherwise."""
    if sys.platform != "linux" or "ANDROID_DATA" in os.environ or "platformdirs" in sys.modules:
        return None
    variable, below_home = _XDG[kind]
    home = os.environ.get("HOME", "")
    said = os.environ.get(variable, f"{home.rstrip('/')}/{below_home}" if home.startswith("/") else "")
    return said if said.startswith("/") else None


_FOLDER = Path(__file__).parents[1] / "families"
#: Folders with copies of archived files, removed when this process ends.
_COPIES: list[TemporaryDirectory[str]] = []


@cache
def family_files() -> dict[str, tuple[str, ...]]:
    """Return the file names of each family, by family name, in alphabetical order."""
    found: dict[str, tuple[str, ...]] = {}
    for line in _read("files.txt").decode("ascii").split():
        name, _, file = line.partition("/")
        found[name] = (*found.get(name, ()), file)
    return found


def families_with(file: str) -> tuple[str, ...]:
    """Return the families with a file named *file*, in alphabetical order."""
    return tuple(name for name, files in family_files().items() if file in files)


@cache
def family_path(name: str, file: str) -> Path:
    """Return the path of *file* of family *name*; for an archived package, a copy for this process's lifetime."""
    path = _FOLDER / name / file
    if file not in family_files().get(name, ()) or path.is_file():
        return path
    from tempfile import TemporaryDirectory

    _COPIES.append(TemporaryDirectory(prefix="dvtcli-"))
    copy = Path(_COPIES[-1].name) / file
    copy.write_bytes(_read(name, file))
    return copy


def _read(*names: str) -> bytes:
    """Read a file of the families' folder, also from an archive."""
    if _FOLDER.is_dir():
        return _FOLDER.joinpath(*names).read_bytes()
    from importlib.resources import files

    return files("dvtcli").joinpath(_FOLDER.name, *names).read_bytes()
