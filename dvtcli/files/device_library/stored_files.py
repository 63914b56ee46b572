"""Library files, with the identity in their names: `0000001E-0705302D-00010025_gen4.eds`.

Finding a file opens none.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from dvtcli.files.device_file import VALUE_SUFFIXES
from dvtcli.files.user_folders import user_folder

_NAME = re.compile(r"([0-9A-F]{8})-([0-9A-F]{8})-([0-9A-F]{8})_(.+)", re.DOTALL)
#: Maximum length of a name in a file system (bytes), less the identity before it.
_LONGEST = 200


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A library file for *vendor_id*, *product_code* and *revision* (0: no revision)."""

    path: Path
    vendor_id: int
    product_code: int
    revision: int

    @property
    def label(self) -> str:
        """The file's original name."""
        return label_of(self.path.name)

    @property
    def identity(self) -> tuple[int, int, int]:
        """Vendor, product, revision."""
        return (self.vendor_id, self.product_code, self.revision)

    @property
    def is_of_one_node(self) -> bool:
        """Whether the file has the values of one node (DCF, XDC)."""
        return self.path.name.lower().endswith(VALUE_SUFFIXES)


def label_of(name: str) -> str:
    """Return the original name of the library file *name*; *name* itself if not of the library."""
    found = _NAME.fullmatch(name)
    return found[4] if found else name


def folder() -> Path:
    """Return the library's folder, existing or not."""
    return user_folder("data") / "eds"


def stored_files() -> tuple[StoredFile, ...]:
    """Return all library files, by identity and name, without opening any."""
    try:
        with os.scandir(folder()) as found:  # a pipe or a folder of such a name is no file of the library
            names = sorted(entry.name for entry in found if _NAME.fullmatch(entry.name) and entry.is_file())
    except OSError:
        return ()
    where = folder()
    return tuple(stored_file(where / name) for name in names)


def stored_file(path: Path) -> StoredFile:
    """Return the library file at *path*, whose name must have an identity."""
    found = _NAME.fullmatch(path.name)
    assert found is not None  # noqa: S101 - who calls has looked
    vendor_id, product_code, revision = (int(found[number], 16) for number in (1, 2, 3))
    return StoredFile(path, vendor_id, product_code, revision)


def stored_path(name: str) -> Path | None:
    """Return the library file with the full name *name*; None if absent."""
    path = folder() / name
    return path if _NAME.fullmatch(name) and path.parent == folder() and path.is_file() else None


def stored_place(identity: tuple[int, int, int], name: str) -> Path:
    """Where a file called *name* is kept for *identity*: vendor, product, revision (0: none)."""
    plain = "".join(char if char.isprintable() and char not in "/\\" else "_" for char in name)
    stem, suffix = os.path.splitext(plain)  # noqa: PTH122 - a name, not a path
    return folder() / f"{identity_word(identity)}_{_shortened(stem, _LONGEST - len(suffix.encode()))}{suffix}"


def identity_word(identity: tuple[int, int, int]) -> str:
    """Return *identity* as the beginning of a library file's name."""
    return "-".join(f"{number:08X}" for number in identity)


def _shortened(stem: str, most: int) -> str:
    """*stem*, in UTF-8 no longer than *most* bytes."""
    return stem.encode("utf-8", "surrogateescape")[: max(1, most)].decode("utf-8", "ignore")
