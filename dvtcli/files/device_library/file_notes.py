"""What is remembered of a file of the library beside it, so that a list of sixty opens none: `about/NAME.json`.

It is a note, never the truth: one that is of another version of dvtcli, of the file before it was changed, too long, or
not what this file writes counts as none. Only numbers and short texts are taken from it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from dvtcli.files.device_library.stored_files import StoredFile, folder
from dvtcli.version import __version__

#: A note is some hundred bytes; beyond this many it is something else.
_MOST_BYTES = 20_000
_LONGEST_TEXT = 4_000


@dataclass(frozen=True, slots=True)
class FileDescription:
    """What the file itself says: its identity (None where it is silent), names, and how many objects."""

    vendor_id: int | None
    product_code: int | None
    revision: int | None
    vendor_name: str
    product_name: str
    objects: int


@dataclass(frozen=True, slots=True)
class KnownFile:
    """Where a file came from, empty where nobody knows, and what is in it, None where that is to be read.

    *preferred*: somebody chose it before others of its identity.
    """

    origin: str = ""
    described: FileDescription | None = None
    preferred: bool = False


def about_place(one: StoredFile) -> Path:
    """Where the note about *one* is."""
    return folder() / "about" / f"{one.path.name}.json"


def remembered(one: StoredFile) -> KnownFile:
    """What the note about *one* says, as far as it can be believed."""
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
    """The text of the note about *one* as the file is now; OSError where it is not there."""
    note = {
        "dvtcli": __version__,
        "from": known.origin,
        "file": _state(one),
        "says": asdict(described),
        "preferred": known.preferred,
    }
    return json.dumps(note, indent=1) + "\n"


def _state(one: StoredFile) -> list[int]:
    """By what a changed file is known: bytes, and when it was written (ns)."""
    found = one.path.stat()
    return [found.st_size, found.st_mtime_ns]


def _described(said: Any) -> FileDescription:
    """ValueError, KeyError or TypeError where it is not what was written."""
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
