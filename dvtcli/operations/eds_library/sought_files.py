"""The files that the words of `eds add` stand for: a file, those of a folder, a family's. Reads no file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from dvtcli.errors import UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES
from dvtcli.files.device_library.stored_files import folder
from dvtcli.operations.user.options import is_file

#: More than any collection of device files has, and looked through in a second.
_MOST_FILES = 20_000
_FAMILY = "family "


@dataclass(frozen=True, slots=True)
class Sought:
    """A file to be added: its *path*, and *origin*, what is said of where it came from."""

    path: Path
    origin: str

    @property
    def shown(self) -> str:
        """The file as it was named."""
        return self.origin if self.origin.startswith(_FAMILY) else str(self.path)


def sought_files(words: tuple[str, ...]) -> tuple[list[Sought], int]:
    """What *words* stand for, each file once, and how many files of folders are no device files.

    A file wins over a family of that name. UsageError for a word that is neither, and for a folder of too many files.
    """
    found: dict[Path, Sought] = {}
    others = 0
    for word in words:
        some, left_out = _of_word(word)
        others += left_out
        for sought in some:
            found.setdefault(sought.path.absolute(), sought)
    return list(found.values()), others


def _of_word(word: str) -> tuple[list[Sought], int]:
    from dvtcli.simulator.network.family_file import family_names

    if is_file(word):
        return [Sought(Path(word), os.path.abspath(word))], 0  # noqa: PTH100 - `resolve` would follow links
    if os.path.isdir(word):  # noqa: PTH112 - Path raises for a name that is too long
        return _of_folder(word)
    if word in family_names():
        from dvtcli.simulator.network.family_file import family_eds

        return [Sought(family_eds(word), f"{_FAMILY}{word}")], 0
    raise UsageError(
        f"{word}: no such file or folder, and no family with an EDS",
        place=word,
        hint=f"families: {', '.join(family_names())}",
    )


def _of_folder(word: str) -> tuple[list[Sought], int]:
    """The device files in *word* and the folders in it, by path; links to folders are not followed."""
    found: list[Path] = []
    others = seen = 0
    own = os.path.realpath(folder())
    for where, folders, names in os.walk(word):
        folders[:] = sorted(
            name for name in folders
            if not name.startswith(".") and os.path.realpath(os.path.join(where, name)) != own  # noqa: PTH118
        )  # fmt: skip
        seen += len(names)
        if seen > _MOST_FILES:
            raise UsageError(f"{word} has more than {_MOST_FILES} files", place=word, hint="name the folder of the EDS")
        device_files = [name for name in names if name.lower().endswith(DEVICE_SUFFIXES) and _is_file_in(where, name)]
        found += (Path(where, name) for name in device_files)
        others += len(names) - len(device_files)
    return [Sought(path, os.path.abspath(path)) for path in sorted(found)], others  # noqa: PTH100


def _is_file_in(where: str, name: str) -> bool:
    """Whether *name* in the folder *where* is a file that ends: no pipe, no device."""
    return os.path.isfile(os.path.join(where, name))  # noqa: PTH113, PTH118 - as above
