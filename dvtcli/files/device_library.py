"""The user's own files of devices: read with the identity in them, and selected by a device's identity."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from enum import IntEnum
from pathlib import Path
from typing import Any

from dvtcli.domain.object_dictionary import ERASED
from dvtcli.errors import UsageError
from dvtcli.files.device_file import VALUE_SUFFIXES
from dvtcli.files.user_folders import user_folder
from dvtcli.version import __version__

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


def files_named(name: str) -> tuple[StoredFile, ...]:
    """Return the library file with the full name *name*, else all files whose original name it is."""
    files = stored_files()
    whole = tuple(file for file in files if file.path.name == name)
    return whole or tuple(file for file in files if file.label == name)


def file_named(name: str) -> Path | None:
    """Return the library file with the full or original name *name*; None if there is none.

    Raises UsageError if several files have this original name.
    """
    found = files_named(name)
    if len(found) > 1:
        raise UsageError(why_several(name, found), hint=f"give a full name: {full_names(found)}")
    return found[0].path if found else None


def why_several(name: str, files: Sequence[StoredFile]) -> str:
    """Say that *files* have the original name *name*."""
    return f"{name} names {len(files)} files of the library"


def full_names(files: Sequence[StoredFile]) -> str:
    """Return the full names of *files*, each of which names one file."""
    return ", ".join(file.path.name for file in files)


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


_MAJOR_SHIFT = 16


class Fit(IntEnum):
    """How a file's revision is like the device's, best first."""

    EXACT = 0
    SAME_MAJOR = 1
    UNSAID = 2
    OTHER = 3


@dataclass(frozen=True, slots=True)
class Match:
    """The *file* for a device of *revision* (None: unknown), and its *rivals*.

    Rivals fit equally well and differ in content, and the user chose none. *preferred*: the user chose *file*.
    """

    file: StoredFile
    fit: Fit
    revision: int | None
    rivals: tuple[StoredFile, ...] = ()
    preferred: bool = False

    @property
    def of_other_revision(self) -> bool:
        """Whether device and file both name a revision, and the revisions differ."""
        return self.fit in (Fit.SAME_MAJOR, Fit.OTHER)

    @property
    def why(self) -> str:
        """The reason for the selection, in words."""
        return f"{self._fits}; preferred to others that fit as well" if self.preferred else self._fits

    @property
    def _fits(self) -> str:
        label, revision = self.file.label, f"0x{self.file.revision:08X}"
        has_product = bool(assigned(self.file.product_code))
        if self.fit is Fit.EXACT:
            return f"vendor, product and revision {revision}" if has_product else f"vendor and revision {revision}"
        equal = "vendor and product" if has_product else "vendor, and neither has a product number"
        if self.fit is Fit.UNSAID:
            who = "the device" if self.revision is None else label
            return f"{equal}; {who} names no revision"
        device = f"0x{self.revision or 0:08X}"
        return f"{equal}; revision {device} on the device, {revision} in {label}"

    @property
    def doubtful(self) -> bool:
        """Whether the file may describe another device: by revision, or because others fit equally well."""
        return self.fit is Fit.OTHER or bool(self.rivals)

    @property
    def note(self) -> str:
        """The warning to users of the file; empty for none."""
        return self.remark("on the device")

    def remark(self, told: str) -> str:
        """Return `note` with *told* as the place of the device's revision."""
        notes = []
        if self.of_other_revision:
            device, described = f"0x{self.revision or 0:08X}", f"0x{self.file.revision:08X}"
            notes.append(f"revision {device} {told}, {described} in {self.file.label}")
        if self.rivals:
            others = ", ".join(rival.label for rival in self.rivals)
            notes.append(
                f"{self.file.label} is taken, the file added last, but {others} would also match: choose with eds "
                f"prefer FILE or eds remove FILE"
            )
        return "; ".join(notes)


def assigned(product_code: int) -> int:
    """Return *product_code*; 0 if it is no product number: all bits set, as in erased memory."""
    return 0 if product_code == ERASED else product_code


def match(files: Iterable[StoredFile], vendor_id: int, product_code: int, revision: int | None) -> Match | None:
    """Return the best of *files* for a device of this identity; None if no file fits.

    A file without a product number (0) fits the devices of its vendor that have none.
    """
    identity = (vendor_id, assigned(product_code))
    fitting = [file for file in files if (file.vendor_id, assigned(file.product_code)) == identity]
    if not fitting or not vendor_id:
        return None
    best = min(fitting, key=lambda file: _rank(file, revision))
    same = [file for file in fitting if file.revision == best.revision]
    first, preferred = first_of(same)
    others = (
        [] if preferred else [file for file in same if file.is_of_one_node == first.is_of_one_node and file != first]
    )
    rivals = tuple(other for other in others if _content(other) != _content(first))
    return Match(first, _fit(first, revision), revision, rivals, preferred)


def first_of(same: Sequence[StoredFile], added: StoredFile | None = None) -> tuple[StoredFile, bool]:
    """Select a file among files of the *same* identity; the flag tells whether the user preferred it.

    *added*, present or not, counts as the newest and as not preferred.
    """
    if len(same) == 1:
        return same[0], False

    def age(file: StoredFile) -> tuple[bool, tuple[int, str]]:
        return file == added, _newest(file)

    first = max(same, key=lambda file: (not file.is_of_one_node, age(file)))
    chosen = max((file for file in same if file != added and remembered(file).preferred), key=age, default=None)
    if chosen is None or age(chosen) < age(first):
        return first, False
    return chosen, True


def taken_of(files: Iterable[StoredFile]) -> dict[StoredFile, bool]:
    """Return the selected file for each identity in *files*, with a flag: preferred by the user."""
    by_identity: dict[tuple[int, int, int], list[StoredFile]] = {}
    for file in files:
        by_identity.setdefault(file.identity, []).append(file)
    return dict(first_of(same) for same in by_identity.values())


def _fit(one: StoredFile, revision: int | None) -> Fit:
    if revision is not None and one.revision == revision:
        return Fit.EXACT
    if not one.revision or revision is None:
        return Fit.UNSAID
    return Fit.SAME_MAJOR if one.revision >> _MAJOR_SHIFT == revision >> _MAJOR_SHIFT else Fit.OTHER


def _rank(one: StoredFile, revision: int | None) -> tuple[int, int]:
    return (_fit(one, revision), -one.revision)


def _newest(one: StoredFile) -> tuple[int, str]:
    """Return the time (ns) when the file was last added or preferred; ties go by name."""
    try:
        return (one.path.stat().st_mtime_ns, one.path.name)
    except OSError:
        return (0, one.path.name)


def _content(one: StoredFile) -> bytes | None:
    try:
        return one.path.read_bytes()
    except OSError:
        return None


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
