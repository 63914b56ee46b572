"""The library of device files for a program: listed and filled. Opens no bus and prints nothing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.api.checks import flags, path, whole
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.operations.results import LibraryAdded, LibraryListing

_U32 = 0xFFFF_FFFF


def eds_library() -> LibraryListing:
    """The device files by which nodes are recognised, as `dvtcli eds add` keeps them; a list of rows."""
    from dvtcli.operations.eds_library.list_files import list_files
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
    """Keep EDS, DCF, XDD and XDC *files*, those of folders, or a family's, for nodes of their identity (0x1018).

    True where none was refused; each row says what became of its file. With *vendor* and *product* (and *revision*,
    None: any) one file is kept for that identity, whatever it says itself. With *dry_run* nothing is written. Where one
    file is given and cannot be kept, InputFileError; UsageError for a name that is nothing's, and where the library
    cannot be written.
    """
    from dvtcli.operations.eds_library.add_files import add_files
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
