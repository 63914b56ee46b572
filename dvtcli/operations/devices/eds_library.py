"""The user's library of EDS, DCF, XDD and XDC files: add and list files."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ERASED, DeviceInfo
from dvtcli.domain.text import plural
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES, must_be_whole, parse_device_file
from dvtcli.files.device_library import (
    FileDescription,
    KnownFile,
    StoredFile,
    about_place,
    assigned,
    file_named,
    first_of,
    folder,
    identity_word,
    note_about,
    remembered,
    stored_file,
    stored_files,
    stored_place,
    taken_of,
)
from dvtcli.files.eds.ini import MOST_BYTES
from dvtcli.files.input_file import read_input_head
from dvtcli.operations.results.library_files import (
    ADDED,
    REFUSED,
    REPLACED,
    THERE,
    AddedFile,
    LibraryAdded,
    LibraryListing,
    LibraryRow,
)
from dvtcli.operations.session.whole_file import write_whole
from dvtcli.operations.user.options import is_file

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.operations.user.session_user import SessionUser

#: More than any collection of device files has, and looked through in a second.
_MOST_FILES = 20_000
_FAMILY = "family "


@dataclass(frozen=True, slots=True)
class Sought:
    """A file to add: its *path*, and *origin*, its source in words."""

    path: Path
    origin: str

    @property
    def shown(self) -> str:
        """Return the file as named by the user."""
        return self.origin if self.origin.startswith(_FAMILY) else str(self.path)


def sought_files(words: tuple[str, ...]) -> tuple[list[Sought], int]:
    """Resolve *words* into files without repetition, and count other files in folders.

    A file wins over a family of that name. Raises UsageError for an unknown word and for a folder with too many files.
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
    """Tell whether *name* in the folder *where* is a regular file."""
    return os.path.isfile(os.path.join(where, name))  # noqa: PTH113, PTH118 - as above


#: vendor, product, revision (0: none)
Identity = tuple[int, int, int]


def add_files(session: SessionUser, words: tuple[str, ...], identity: Mapping[str, int] | None = None) -> LibraryAdded:
    """Add the files of *words* (files, folders, families) to the library under their identity.

    *identity* (`vendor`, `product`, `revision`) replaces the identity of a single file; without a product it is for
    nodes that have no product number. A single file that cannot be added raises InputFileError; of several files its
    row shows the error. Raises UsageError for a word without files, or if the library cannot be written.
    """
    sought, others = sought_files(words)
    given = None if identity is None else _given(identity, sought)
    if not sought:
        raise UsageError(f"{' '.join(words)}: no EDS, DCF, XDD or XDC file in {plural(others, 'file')}")
    rows = []
    for number, sought_file in enumerate(sought):
        session.reporter.progress("reading device files", number, len(sought))
        try:
            rows.append(_add(sought_file, given, dry_run=session.dry_run))
        except InputFileError as wrong:
            if words == (sought_file.shown.removeprefix("family "),):
                raise
            rows.append(_refused(sought_file, wrong))
    return LibraryAdded(tuple(rows), str(folder()), others, session.dry_run, _are_all_taken(rows))


def _are_all_taken(rows: list[AddedFile]) -> bool:
    """Tell whether each added file is now the preferred file of its identity."""
    files, kept = stored_files(), {row.kept for row in rows}
    taken = {str(file.path) for file in taken_of(files)}
    return all(str(file.path) in taken for file in files if str(file.path) in kept)


def _given(identity: Mapping[str, int], sought: list[Sought]) -> Identity:
    """Return the given identity for a single file; raises UsageError for several files or an invalid identity."""
    if len(sought) != 1:
        raise UsageError(
            f"one file has it, and these are {len(sought)}", hint="add each with its own", given={"identity": None}
        )
    if not identity.get("vendor"):
        raise UsageError(
            "a vendor is needed",
            given={"identity": None},
            hint=Hint(Action.GIVE, {"identity": "vendor=0x1E,product=0x0705302D"}),
        )
    return identity["vendor"], assigned(identity.get("product", 0)), identity.get("revision", 0)


def _refused(one: Sought, wrong: InputFileError) -> AddedFile:
    why = f"{wrong.text}: {wrong.why}" if wrong.why else wrong.text
    return AddedFile(one.shown, REFUSED, why=why, place=wrong.place or str(one.path), hint=wrong.hint or "")


def _add(one: Sought, given: Identity | None, *, dry_run: bool) -> AddedFile:
    data, dictionary = _read(one.path)
    identity = given or _own_identity(one, dictionary.info)
    there = [kept for kept in stored_files() if kept.identity == identity]
    same = next((kept for kept in there if _holds(kept, data)), None)
    if same is not None:
        note = "" if same.label == one.path.name else f"it is there as {same.label}"
        return AddedFile(one.shown, THERE, *identity, str(same.path), note)
    target = _target(one, identity, there, data)
    outcome = REPLACED if target.path.exists() else ADDED
    is_preferred = target in there and first_of(there) == (target, True)  # else it came this moment
    if not dry_run:
        _keep(target, data, KnownFile(one.origin, preferred=is_preferred), dictionary)
    beside = [kept for kept in there if kept != target]
    first = target if is_preferred else first_of([*beside, target], target)[0]
    return AddedFile(one.shown, outcome, *identity, str(target.path), _beside(target, beside, first))


def _target(one: Sought, identity: Identity, there: list[StoredFile], data: bytes) -> StoredFile:
    """Choose the place of *one*: replaces the file from the same source, else a new name."""
    for kept in there:
        if remembered(kept).origin == one.origin:
            return kept
    target, number = stored_file(stored_place(identity, one.path.name)), 1
    while target.path.exists() and not _holds(target, data):  # else somebody added the same this moment
        number += 1
        target = stored_file(stored_place(identity, f"{one.path.stem}-{number}{one.path.suffix}"))
    return target


def _beside(target: StoredFile, others: list[StoredFile], first: StoredFile) -> str:
    """Describe *others* with the same identity and different contents; *first* is preferred."""
    if not others:
        return ""
    if first != target:
        return f"{first.label} of the same vendor, product and revision stays the one that is taken: eds prefer decides"
    labels = ", ".join(other.label for other in others)
    return f"{labels} of the same vendor, product and revision says something else: {target.label} is taken from now on"


def _read(path: Path) -> tuple[bytes, ObjectDictionary]:
    """Read a file and its dictionary; raises InputFileError if invalid."""
    try:
        data = read_input_head(path, MOST_BYTES + 1)
    except OSError as failed:
        raise InputFileError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
    found = parse_device_file(data, path.name)
    must_be_whole(found)
    return data, found.dictionary


def _own_identity(one: Sought, info: DeviceInfo) -> Identity:
    """Return the file's identity; raises InputFileError if no node can have it."""
    vendor, product, revision = (
        None if number == ERASED else number for number in (info.vendor_id, info.product_code, info.revision_number)
    )
    if not vendor or product is None:
        lacks, number = ("product number", info.product_code) if vendor else ("vendor number", info.vendor_id)
        has = "" if number is None else f" ({'0' if not number else f'0x{number:08X}'} is not assigned)"
        raise InputFileError(
            f"{one.shown}: it has no {lacks}{has}, so it identifies no node",
            place=str(one.path),
            hint=Hint(Action.FIND_NODES) + _by_hand(vendor) + Hint(Action.GIVE_EDS, why="or {} each time"),
        )
    return vendor, product, revision or 0


def _by_hand(vendor: int | None) -> Hint:
    """How to add a file without a *vendor*, or without a product number, for the identity of a node."""
    if not vendor:
        return Hint(Action.ADD_EDS, {"identity": "vendor=…,product=…"}, " shows the node's identity: {}")
    own = f"vendor=0x{vendor:X}"
    hint = Hint(Action.ADD_EDS, {"identity": f"{own},product=…"}, " shows the node's identity: {}")
    return hint + Hint(Action.ADD_EDS, {"identity": own}, ", or, if it has no product number, {}")


def _holds(kept: StoredFile, data: bytes) -> bool:
    try:
        return kept.path.stat().st_size == len(data) and kept.path.read_bytes() == data
    except OSError:
        return False


def _keep(target: StoredFile, data: bytes, known: KnownFile, dictionary: ObjectDictionary) -> None:
    """Write the file, then its note; raises UsageError if the file cannot be written."""
    where = target.path.parent
    try:
        where.mkdir(parents=True, exist_ok=True)
    except OSError as failed:
        raise UsageError(f"{where}: {failed.strerror or failed}", place=str(where)) from failed
    write_whole(target.path, data)
    put_first(target)
    remember(target, known, dictionary)


def put_first(one: StoredFile) -> None:
    """Make *one* the newest, and preferred, of its identity; raises UsageError if impossible."""
    try:
        others = [other for other in stored_files() if other.identity == one.identity and other.path != one.path]
        newest = max((other.path.stat().st_mtime_ns for other in others), default=0)
        os.utime(one.path)
        if one.path.stat().st_mtime_ns <= newest:  # a file from the future, or a file system with a coarse clock
            os.utime(one.path, ns=(newest + 2_000_000_000,) * 2)
    except OSError as failed:
        raise UsageError(f"{one.path}: {failed.strerror or failed}", place=str(one.path)) from failed


def remember(one: StoredFile, known: KnownFile, dictionary: ObjectDictionary) -> FileDescription:
    """Write a note of the contents of *one* and of *known*, if possible.

    Without a note the file is read when listed.
    """
    found = described(dictionary)
    with suppress(UsageError):
        write_note(one, known, found)
    return found


def described(dictionary: ObjectDictionary) -> FileDescription:
    """Summarise a file with *dictionary*."""
    info = dictionary.info
    return FileDescription(
        info.vendor_id, info.product_code, info.revision_number, info.vendor_name, info.product_name, len(dictionary)
    )


def write_note(one: StoredFile, known: KnownFile, found: FileDescription) -> None:
    """Write a note of *known* and *found*; raises UsageError if impossible."""
    place = about_place(one)
    try:
        place.parent.mkdir(exist_ok=True)
        text = note_about(one, known, found)
    except OSError as failed:
        raise UsageError(f"{place.parent}: {failed.strerror or failed}", place=str(place)) from failed
    write_whole(place, text.encode())


_IDENTITY = re.compile(r"[0-9A-F]{8}-[0-9A-F]{8}(-[0-9A-F]{8})?", re.IGNORECASE)


def list_files(session: SessionUser) -> LibraryListing:
    """List the library by vendor, product and revision; unreadable files have an error in their row."""
    return _listing(session)


def remove_files(session: SessionUser, words: tuple[str, ...]) -> LibraryListing:
    """Remove the files *words*, by number, name or identity, and list the rest. Asks.

    Raises UsageError for an unknown or ambiguous word, or if a file cannot be removed.
    """
    chosen = _chosen(words)
    labels = tuple(f"{identity_word(listed_file.identity)} {listed_file.label}" for listed_file in chosen)
    session.consent(f"remove from the library: {', '.join(labels)}?")
    if not session.dry_run:
        for file in chosen:
            _remove(file)
    return _listing(session, removed=labels)


def prefer_file(session: SessionUser, word: str) -> LibraryListing:
    """Prefer the file *word* to others of its identity, without a warning, until another is added.

    Raises UsageError for an unknown or ambiguous word, or if it cannot be noted.
    """
    chosen = _chosen((word,))
    if len(chosen) != 1:
        labels = ", ".join(file.path.name for file in chosen)
        raise UsageError(f"{word} names {len(chosen)} files", hint=f"give a name: {labels}")
    if not session.dry_run:
        _put_first(chosen[0])
    alone = sum(other.identity == chosen[0].identity for other in stored_files()) == 1
    return replace(_listing(session, preferred=chosen[0].label), is_alone=alone)


def _put_first(one: StoredFile) -> None:
    """Make it newest and preferred; raises UsageError if impossible: its age stays."""
    from dvtcli.operations.session.simulated_nodes import read_dictionary

    known, held = remembered(one), one.path.stat()
    found = known.described or described(read_dictionary(one.path))
    put_first(one)
    try:
        write_note(one, replace(known, preferred=True), found)
    except UsageError:
        os.utime(one.path, ns=(held.st_atime_ns, held.st_mtime_ns))
        raise


def _chosen(words: tuple[str, ...]) -> list[StoredFile]:
    files = stored_files()
    found: dict[StoredFile, None] = {}
    for word in words:
        found.update(dict.fromkeys(_named(word, files)))
    return list(found)


def _named(word: str, files: tuple[StoredFile, ...]) -> list[StoredFile]:
    """Find library files by *word*: number in the list, identity, or name."""
    if word.isdecimal() and 1 <= int(word) <= len(files):
        return [files[int(word) - 1]]
    if _IDENTITY.fullmatch(word):
        found = [file for file in files if f"{identity_word(file.identity)}-".startswith(f"{word.upper()}-")]
    else:
        named = file_named(word)
        found = [file for file in files if file.path == named]
    if not found:
        hint = Hint(Action.LIST_EDS, why="shows them: a number, a name, or vendor-product[-revision] in hex")
        raise UsageError(f"no file of the library is {word}", hint=hint)
    return found


def _remove(one: StoredFile) -> None:
    try:
        one.path.unlink(missing_ok=True)
        about_place(one).unlink(missing_ok=True)
    except OSError as failed:
        raise UsageError(f"{one.path}: {failed.strerror or failed}", place=str(one.path)) from failed


def _listing(session: SessionUser, removed: tuple[str, ...] = (), preferred: str = "") -> LibraryListing:
    files = stored_files()
    taken = taken_of(files)
    rows = []
    for number, library_file in enumerate(files):
        session.reporter.progress("reading the library", number, len(files))
        rows.append(
            replace(
                _row(number + 1, library_file), taken=library_file in taken, preferred=taken.get(library_file, False)
            )
        )
    return LibraryListing(tuple(rows), str(folder()), removed, preferred, _strangers(len(files)), session.dry_run)


def _strangers(known: int) -> int:
    """How many files in the library's folder have names that no `eds add` made."""
    try:
        with os.scandir(folder()) as found:
            return sum(entry.is_file() and not entry.name.startswith(".") for entry in found) - known
    except OSError:
        return 0


def problem_of(path: Path) -> str:
    """Explain why the library file at *path* is unreadable; empty if readable or no library file.

    Reads the file only without a current note.
    """
    if path.parent != folder():
        return ""
    said = _said(stored_file(path))
    return said if isinstance(said, str) else ""


def _said(one: StoredFile) -> FileDescription | str:
    """Return the file's summary, or why it is unreadable."""
    known = remembered(one)
    try:
        return known.described or _describe(one, known)
    except DvtcliError as wrong:
        return f"{wrong.text}: {wrong.why}" if wrong.why else wrong.text


def _row(number: int, one: StoredFile) -> LibraryRow:
    known, said = remembered(one), _said(one)
    if isinstance(said, str):
        return LibraryRow(number, *one.identity, one.label, str(one.path), origin=known.origin, problem=said)
    revision = 0 if said.revision in (None, ERASED) else said.revision
    by_hand = (said.vendor_id, said.product_code, revision) != one.identity
    return LibraryRow(
        number, *one.identity, one.label, str(one.path), said.vendor_name, said.product_name, said.objects,
        known.origin, by_hand,
    )  # fmt: skip


def _describe(one: StoredFile, known: KnownFile) -> FileDescription:
    """Summarise the file by reading it, and note the summary."""
    from dvtcli.operations.session.simulated_nodes import read_dictionary

    return remember(one, known, read_dictionary(one.path))
