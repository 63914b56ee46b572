"""The library of device files as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.domain.hint import Hint, next_step
from dvtcli.domain.text import join_some
from dvtcli.errors import DvtcliError, ended_with
from dvtcli.operations.results.documents import Answer, Document, Rows, Short


@dataclass(frozen=True, slots=True)
class ProfileRow(Short):
    """A profile: identities (0x1018) by vendor, file; *own* if the user's."""

    name: str
    title: str
    vendor_ids: tuple[int, ...]
    file: str
    own: bool

    def document(self) -> Document:
        """A profile in `dvtcli.profiles/1`."""
        return {
            "name": self.name,
            "title": self.title,
            "vendor_ids": list(self.vendor_ids),
            "file": self.file,
            "own": self.own,
        }


@dataclass(frozen=True, slots=True)
class ProfileListing(Answer, Rows[ProfileRow]):
    """All profiles, and the *folder* for the user's own."""

    renderer: ClassVar = "library_lines:profile_list_lines"

    rows: tuple[ProfileRow, ...]
    folder: str
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.profiles/1`."""
        return {
            "schema": "dvtcli.profiles/1",
            "folder": self.folder,
            "profiles": [row.document() for row in self.rows],
        }


@dataclass(frozen=True, slots=True)
class ProfileShown(Answer):
    """A profile: key, written value, and reason of every value; the rest is as in *like*, or the standard's."""

    renderer: ClassVar = "library_lines:profile_lines"

    row: ProfileRow
    values: tuple[tuple[str, str, str], ...]
    like: str | None
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.profile/1`."""
        return {
            "schema": "dvtcli.profile/1",
            **self.row.document(),
            "like": self.like,
            "values": [{"key": key, "value": value, "reason": reason} for key, value, reason in self.values],
        }


ADDED, THERE, REPLACED, REFUSED = "added", "already there", "replaced", "refused"


@dataclass(frozen=True, slots=True)
class AddedFile(Short):
    """The result for a *file*: *outcome*, its identity, and its place in the library.

    A refused file has *why*, *place* (`FILE:LINE`) and *hint*; *note* is a remark on other files.
    """

    file: str
    outcome: str
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    kept: str = ""
    note: str = ""
    why: str = ""
    place: str = ""
    hint: Hint | str = ""

    def document(self) -> Document:
        """A file in `dvtcli.eds-added/1`."""
        return {
            "file": self.file,
            "outcome": self.outcome,
            "vendor_id": self.vendor_id,
            "product_code": self.product_code,
            "revision": self.revision,
            "kept": self.kept or None,
            "note": self.note,
            "why": self.why,
            "place": self.place,
            "hint": self.hint,
            "next": next_step(self.hint),
        }


@dataclass(frozen=True, slots=True)
class LibraryAdded(Answer, Rows[AddedFile]):
    """The result for files to be added to the library in *folder*; *others* are no device files.

    *are_all_taken*: no other file is preferred to them.
    """

    renderer: ClassVar = "library_lines:added_lines"

    rows: tuple[AddedFile, ...]
    folder: str
    others: int = 0
    dry_run: bool = False
    are_all_taken: bool = True

    def __bool__(self) -> bool:
        """Tell whether no file was refused."""
        return not self.exit_code

    @property
    def exit_code(self) -> int:
        """4 for a refused file."""
        return 4 if any(row.outcome == REFUSED for row in self.rows) else 0

    def count(self) -> dict[str, int]:
        """Count files by outcome."""
        return {
            outcome: sum(row.outcome == outcome for row in self.rows) for outcome in (ADDED, REPLACED, THERE, REFUSED)
        }

    @property
    def failure_of_document(self) -> DvtcliError | None:
        """The error for a nonzero exit code, for programs."""
        refused = [row.file for row in self.rows if row.outcome == REFUSED]
        return ended_with(4, f"refused: {join_some(refused)}") if refused else None

    def document(self) -> Document:
        """`dvtcli.eds-added/1`."""
        return {
            "schema": "dvtcli.eds-added/1",
            "folder": self.folder,
            "files": [row.document() for row in self.rows],
            "count": {name.replace(" ", "_"): number for name, number in self.count().items()},
            "no_device_files": self.others,
            "dry_run": self.dry_run,
        }


@dataclass(frozen=True, slots=True)
class LibraryRow(Short):
    """A file of the library with its *number* in the list: identity, contents, source.

    *revision* 0 is none. *by_hand*: its identity was given by the user. *problem*: why it is unreadable. *taken*: it is
    used for its identity; *preferred*: by the user's choice.
    """

    number: int
    vendor_id: int
    product_code: int
    revision: int
    name: str
    path: str
    vendor_name: str = ""
    product_name: str = ""
    objects: int | None = None
    origin: str = ""
    by_hand: bool = False
    problem: str = ""
    taken: bool = True
    preferred: bool = False

    @property
    def identity(self) -> tuple[int, int, int]:
        """Vendor, product, revision."""
        return (self.vendor_id, self.product_code, self.revision)

    def document(self) -> Document:
        """A file in `dvtcli.eds-library/1`."""
        return {
            "number": self.number,
            "vendor_id": self.vendor_id,
            "product_code": self.product_code,
            "revision": self.revision or None,
            "vendor": self.vendor_name,
            "product": self.product_name,
            "objects": self.objects,
            "name": self.name,
            "file": self.path,
            "from": self.origin,
            "by_hand": self.by_hand,
            "problem": self.problem,
            "taken": self.taken,
            "preferred": self.preferred,
        }


@dataclass(frozen=True, slots=True)
class LibraryListing(Answer, Rows[LibraryRow]):
    """The library in *folder*, after *removed* files were removed and *preferred* was put first."""

    renderer: ClassVar = "library_lines:listing_lines"
    use_pager: ClassVar = True

    rows: tuple[LibraryRow, ...]
    folder: str
    removed: tuple[str, ...] = ()
    preferred: str = ""
    #: files in the folder not made by `eds add`
    strangers: int = 0
    dry_run: bool = False
    exit_code: int = 0
    #: whether *preferred* is the only file of its identity
    is_alone: bool = False

    def document(self) -> Document:
        """`dvtcli.eds-library/1`."""
        return {
            "schema": "dvtcli.eds-library/1",
            "folder": self.folder,
            "files": [row.document() for row in self.rows],
            "removed": list(self.removed),
            "preferred": self.preferred or None,
            "strangers": self.strangers,
            "dry_run": self.dry_run,
        }
