"""Where the families that come with dvtcli are kept: a folder each. Knows names of files, and reads none of them.

`families/files.txt` lists them, since no folder can be listed if the package is in an archive.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tempfile import TemporaryDirectory

_FOLDER = Path(__file__).parents[1] / "families"
#: Folders with copies of files of an archive; each goes when this process ends.
_COPIES: list[TemporaryDirectory[str]] = []


@cache
def family_files() -> dict[str, tuple[str, ...]]:
    """The names of each family's files, by its name, in alphabetical order."""
    found: dict[str, tuple[str, ...]] = {}
    for line in _read("files.txt").decode("ascii").split():
        name, _, file = line.partition("/")
        found[name] = (*found.get(name, ()), file)
    return found


def families_with(file: str) -> tuple[str, ...]:
    """The families that have a *file* of this name, in alphabetical order."""
    return tuple(name for name, files in family_files().items() if file in files)


@cache
def family_path(name: str, file: str) -> Path:
    """Where *file* of the family *name* is; if the package is in an archive, a copy that goes with this process."""
    path = _FOLDER / name / file
    if file not in family_files().get(name, ()) or path.is_file():
        return path
    from tempfile import TemporaryDirectory

    _COPIES.append(TemporaryDirectory(prefix="dvtcli-"))
    copy = Path(_COPIES[-1].name) / file
    copy.write_bytes(_read(name, file))
    return copy


def _read(*names: str) -> bytes:
    """What a file of that folder holds, be it in an archive."""
    if _FOLDER.is_dir():
        return _FOLDER.joinpath(*names).read_bytes()
    from importlib.resources import files

    return files("dvtcli").joinpath(_FOLDER.name, *names).read_bytes()
