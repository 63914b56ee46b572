"""Notes about library files (`about/NAME.json`), so that a listing opens no file.

A note is ignored if it comes from another dvtcli version, does not match its file, or is too long or malformed. Only
numbers and short texts are used.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from dvtcli.files.device_library.stored_files import StoredFile, folder
from dvtcli.version import __version__

#: Maximum size of a note (bytes), normally some hundred.
_MOST_BYTES = 20_000
_LONGEST_TEXT = 4_000


@dataclass(frozen=True, slots=True)
class FileDescription:
    """A file's own identity (None if the file has none), names, and number of objects."""

    vendor_id: int | None
    product_code: int | None
    revision: int | None
    vendor_name: str
    product_name: str
    objects: int


@dataclass(frozen=True, slots=True)
class KnownFile:
    """A file's origin (empty if unknown) and contents (None: still to be read).

    *preferred*: the user chose this file among files of the same identity.
    """

    origin: str = ""
    described: FileDescription | None = None
    preferred: bool = False


def about_place(one: StoredFile) -> Path:
    """Return the path of the note about *one*."""
    return folder() / "about" / f"{one.path.name}.json"


def remembered(one: StoredFile) -> KnownFile:
    """Return the contents of the note about *one*, as far as credible."""
    try:
        with about_place(one).open("rb") as file:
            note = json.loads(file.read(_MOST_BYTES + 1))
        origin = _text(note["from"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return KnownFile()
    try:
        is_so = note["file"] == _state(one)
        preferred = is_so and note["preferred"] is True
        is_known = is_so and note["dvtcli"] == __version__
        return KnownFile(origin, _described(note["says"]) if is_known else None, preferred)
    except (OSError, ValueError, KeyError, TypeError):
        return KnownFile(origin)


def note_about(one: StoredFile, known: KnownFile, described: FileDescription) -> str:
    """Return the text of a note about the present state of *one*. Raises OSError if the file is gone."""
    note = {
        "dvtcli": __version__,
        "from": known.origin,
        "file": _state(one),
        "says": asdict(described),
        "preferred": known.preferred,
    }
    return json.dumps(note, indent=1) + "\n"


def _state(one: StoredFile) -> list[int]:
    """Return size (bytes) and modification time (ns), which show a change of the file."""
    found = one.path.stat()
    return [found.st_size, found.st_mtime_ns]


def _described(said: Any) -> FileDescription:
    """Parse a note's description. Raises ValueError, KeyError or TypeError if malformed."""
    found = {field.name: said[field.name] for field in fields(FileDescription)}
    for name in ("vendor_name", "product_name"):
        _text(found[name])
    for name in ("vendor_id", "product_code", "revision"):
        if found[name] is not None:
            _number(found[name])
    _number(found["objects"])
    return FileDescription(**found)


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
        raise ValueError("no short text")
    return value


def _number(value: Any) -> None:
    if type(value) is not int or not 0 <= value <= 0xFFFF_FFFF:
        raise ValueError("no number of 32 bits")
