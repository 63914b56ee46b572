"""Locate the families shipped with dvtcli, a folder each, without reading them.

`families/files.txt` lists them, because folders in an archived package cannot be listed.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tempfile import TemporaryDirectory

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
