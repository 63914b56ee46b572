"""List, prefer and remove files of the library. Reads a file only if its note is missing."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ERASED
from dvtcli.errors import DvtcliError, UsageError
from dvtcli.files.device_library.file_notes import FileDescription, KnownFile, about_place, remembered
from dvtcli.files.device_library.match import taken_of
from dvtcli.files.device_library.stored_files import StoredFile, folder, identity_word, stored_file, stored_files
from dvtcli.operations.eds_library.add_files import described, put_first, remember, write_note
from dvtcli.operations.results.library_files import LibraryListing, LibraryRow

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.operations.user.session_user import SessionUser

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
        raise UsageError(f"{word} names {len(chosen)} files", hint=f"which one? {labels}")
    if not session.dry_run:
        _put_first(chosen[0])
    alone = sum(other.identity == chosen[0].identity for other in stored_files()) == 1
    return replace(_listing(session, preferred=chosen[0].label), is_alone=alone)


def _put_first(one: StoredFile) -> None:
    """Make it newest and preferred; raises UsageError if impossible: its age stays."""
    from dvtcli.operations.opening.simulated_nodes import read_dictionary

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
        found = [file for file in files if word in (file.path.name, file.label)]
        if len(found) > 1:
            names = ", ".join(file.path.name for file in found)
            raise UsageError(f"{word} names {len(found)} files of the library", hint=f"which one? {names}")
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
        session.tell.progress("reading the library", number, len(files))
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
    from dvtcli.operations.opening.simulated_nodes import read_dictionary

    return remember(one, known, read_dictionary(one.path))
