"""The library of device files for a program: listed and filled. Opens no bus and prints nothing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import flags, path, whole, word
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.operations.results import LibraryAdded, LibraryListing, ProfileListing, ProfileShown


def profiles() -> ProfileListing:
    """List the known device families, including the user's; a list of rows.

    Raises InputFileError for an unreadable profile of the user.
    """
    from dvtcli.operations.known_devices.show_profiles import list_profiles

    return list_profiles()


def profile(name: str) -> ProfileShown:
    """Return the profile *name* with the reason for each value.

    Raises UsageError if unknown, InputFileError if its file is invalid.
    """
    from dvtcli.operations.known_devices.show_profiles import show_profile

    word("name", name, "the name of a device family, as `dvtcli.profiles()` lists them")
    with errors_in_calls():
        return show_profile(name)


_U32 = 0xFFFF_FFFF


def eds_library() -> LibraryListing:
    """List the library of device files, as kept by `dvtcli eds add`; a list of rows."""
    from dvtcli.operations.known_devices.eds_library import list_files
    from dvtcli.operations.session.session import Session

    with errors_in_calls(), Session() as session:
        return list_files(session)


def add_eds(
    *files: str | Path,
    vendor: int | None = None,
    product: int | None = None,
    revision: int | None = None,
    dry_run: bool = False,
) -> LibraryAdded:
    """Add EDS, DCF, XDD and XDC *files*, folders or a family to the library, by their identity (0x1018).

    True if none was refused; each row has a file's outcome. *vendor* and *product* (and *revision*, None: any) replace
    the identity of a single file. *dry_run* writes nothing. Raises InputFileError if a single file cannot be added;
    UsageError for an unknown name, or if the library cannot be written.
    """
    from dvtcli.operations.known_devices.eds_library import add_files
    from dvtcli.operations.session.session import Session

    flags(dry_run=dry_run)
    chosen = tuple(str(path("files", file)) for file in files)
    if not chosen:
        raise UsageError("which files? 'drive.eds', a folder, a family, …")
    given = {"vendor": vendor, "product": product, "revision": revision}
    identity = {
        name: whole(name, value, "a part of the identity (0x1018)", _U32)
        for name, value in given.items()
        if value is not None
    }
    with errors_in_calls(), Session(Options(dry_run=dry_run)) as session:
        return add_files(session, chosen, identity or None)
