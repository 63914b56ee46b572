"""Device profiles as answers. Knows no terminal and no session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document, Rows, Short


@dataclass(frozen=True, slots=True)
class ProfileRow(Short):
    """One profile: its identities (0x1018) by vendor, and its file; *own* where it is the user's."""

    name: str
    title: str
    vendor_ids: tuple[int, ...]
    file: str
    own: bool

    def document(self) -> Document:
        """One profile of `dvtcli.profiles/1`."""
        return {
            "name": self.name,
            "title": self.title,
            "vendor_ids": list(self.vendor_ids),
            "file": self.file,
            "own": self.own,
        }


@dataclass(frozen=True, slots=True)
class ProfileListing(Answer, Rows[ProfileRow]):
    """The profiles there are, and the *folder* that the user's own belong into."""

    renderer: ClassVar = "profile_lines:profile_list_lines"

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
    """One profile: key, value as written, and reason of every value; the rest is as in *like*, or the standard's."""

    renderer: ClassVar = "profile_lines:profile_lines"

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
